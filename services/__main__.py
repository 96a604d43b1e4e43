"""Run one service: ``python -m services NAME [OPTIONS]``."""

from __future__ import annotations

import sys

from services.catalog import load_component, load_named_service, service_kinds
from services.runtime.container_main import NAME as CONTAINER
from services.runtime.container_main import run_container_command_line
from services.runtime.errors import BadInput
from services.runtime.main import run_command_line

USAGE = f"""Usage: python -m services NAME [OPTIONS]

  Run one service; python -m services NAME --help shows its options.

Services: {", ".join(service_kinds())}; {CONTAINER} runs several nodes in one process
"""


def run(arguments: list[str]) -> None:
    """Run the service named by the first argument with the other arguments as options; ends the process."""
    if not arguments or arguments[0] in ("-h", "--help"):
        (sys.stdout if arguments else sys.stderr).write(USAGE)
        sys.exit(0 if arguments else 2)
    name, *options = arguments
    if name == CONTAINER:
        run_container_command_line(options, load_component, f"python -m services {name}")
    try:
        service = load_named_service(name)
    except BadInput as error:
        sys.stderr.write(f"services: {error}\n")
        sys.exit(2)
    run_command_line(service, options, f"python -m services {name}")


run(sys.argv[1:])
