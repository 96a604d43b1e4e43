"""The real parameter service with some sets, and ``elea param`` in this process."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from deploy.commands.cli import main
from tests.harness.processes import Network, Process
from tests.services.params.parameter_client import ARM_PARAMETERS, ParameterTestClient, arm_announcement, start_and_wait

SETS = "/robot_control", "/tb3_0/waypoint", "/tb3_1/waypoint"


class CommandResult(NamedTuple):
    """Exit status, standard output and standard error of a command."""

    status: int
    out: str
    err: str


RunCommand = Callable[..., CommandResult]


class ParameterServiceProcess:
    """A network with the service and a client that announces sets."""

    def __init__(self, network: Network, client: ParameterTestClient, folder: Path) -> None:
        self.network, self.client, self._file = network, client, folder / "params.db"
        self.service = self.start()

    def start(self) -> Process:
        """Start the service, always on the same file, and announce all sets."""
        service = self.service = start_and_wait(self.network, self.client, self._file)
        self.client.announce(arm_announcement(node="/arm"))
        self.client.announce(arm_announcement(node="/reference", parameters=ARM_PARAMETERS[:2]))
        for name in SETS[1:]:
            self.client.announce(arm_announcement(name, name, parameters=ARM_PARAMETERS[1:3]))
        return service


def param_command(
    service: ParameterServiceProcess, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> RunCommand:
    """Return a function that runs ``elea param VERB ...`` in this process."""

    def run(verb: str, *words: str) -> CommandResult:
        options = ["--connect", service.network.endpoint, "--timeout", "60"]
        monkeypatch.setattr(sys, "argv", ["elea", "param", verb, *options, *words])
        capsys.readouterr()
        status: Any = 0
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
        return CommandResult(status, *capsys.readouterr())

    return run
