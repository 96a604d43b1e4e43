"""``python -m deploy``, which ``./elea`` runs."""

import sys

from deploy.commands.cli import main

try:
    main()
except SystemExit as ended:
    if "zenoh" in sys.modules:
        from services.runtime.process import exit_now

        # A thread of Zenoh may be on its way into Python: were the interpreter taken down beneath it, it would abort.
        exit_now(ended.code if isinstance(ended.code, int) else 1)
    raise
