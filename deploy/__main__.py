"""``python -m deploy``, which ``./elea`` runs."""

import sys

try:
    from deploy.commands.cli import main

    main()
except ModuleNotFoundError as error:
    package = (error.name or "").partition(".")[0]
    if package in ("", "deploy", "services", "models", "messages"):
        raise
    sys.stderr.write(
        f"elea: the Python package {package} is missing in {sys.prefix}: was its installation cut off, or a file in it "
        "removed? Remove that folder, and the next ./elea installs it again\n"
    )
    sys.exit(2)
except SystemExit as ended:
    if "zenoh" in sys.modules:
        from services.runtime.process import exit_now

        # A Zenoh thread may be about to enter Python: tearing down the interpreter under it would abort the process.
        exit_now(ended.code if isinstance(ended.code, int) else 1)
    raise
