"""``python -m services NAME``: one entry point for all services, whose usage shows how it was called."""

from __future__ import annotations

import os
import subprocess
import sys

from services.catalog import load_named_service, service_kinds
from services.runtime.process import PROGRAM, ROOT


def run(*arguments: str, program: str | None = None) -> tuple[int, str, str]:
    """Run it; return exit status, standard output and standard error."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)} | ({PROGRAM: program} if program else {})
    command = [sys.executable, "-P", "-m", "services", *arguments]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    return ran.returncode, ran.stdout, ran.stderr


def test_the_usage_names_all_services_and_a_wrong_name_gets_the_nearest() -> None:
    status, out, _ = run("--help")
    assert status == 0
    assert all(kind in out for kind in service_kinds())
    assert run()[0] == 2
    status, _, err = run("wayponit")
    assert (status, "unknown service 'wayponit'; did you mean 'waypoint'?" in err) == (2, True)


def test_the_usage_line_says_how_a_service_was_called() -> None:
    assert run("waypoint", "--help")[1].startswith("Usage: python -m services waypoint [OPTIONS]")
    status, _, err = run("waypoint", "--bad")
    assert (status, err.startswith("Usage: python -m services waypoint [OPTIONS]")) == (2, True)
    out = run("waypoint", "--help", program="./elea run waypoint")[1]
    assert out.startswith("Usage: ./elea run waypoint [OPTIONS]")


def test_every_service_is_declared_under_the_name_of_its_folder() -> None:
    assert {"sim", "controller_manager", "waypoint"} <= set(service_kinds())
    assert [load_named_service(kind).name for kind in service_kinds()] == list(service_kinds())
