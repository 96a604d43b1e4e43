"""``./elea up`` for fleets with faulty services: a service named after a file in ``services`` is run from there."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import msgspec

from deploy.commands.cli import main
from deploy.fleet import Fleet
from deploy.processes import ProcessSpec, plan_processes
from deploy.service_parameters import RunOptions
from services.runtime.process import die_with_parent

FAULTY = Path(__file__).parent / "services"


def with_faults(fleet: Fleet, terms: RunOptions) -> tuple[ProcessSpec, ...]:
    """Return the processes of a fleet, with the faulty services' modules replaced."""
    return tuple(_replaced(each) for each in plan_processes(fleet, terms))


def _replaced(process: ProcessSpec) -> ProcessSpec:
    name = process.nodes[0].name.rpartition("/")[2]
    if not (FAULTY / f"{name}.py").is_file():
        return process
    place = process.argv.index("services")
    assert process.argv[place + 1] == process.kind
    faulty = f"tests.faults.services.{name}"
    return msgspec.structs.replace(process, argv=(*process.argv[:place], faulty, *process.argv[place + 2 :]))


if __name__ == "__main__":
    die_with_parent()
    with patch("deploy.run_fleet.plan_processes", with_faults):
        main()
