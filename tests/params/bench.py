"""The real parameter service with some sets, and ``elea param`` in this process."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from deploy.commands.cli import main
from tests.params.sets import ARM, Asking, arm, serving
from tests.processes import Network, Process

SETS = "/robot_control", "/tb3_0/waypoint", "/tb3_1/waypoint"


class Said(NamedTuple):
    """Exit status, standard output and errors of a command line."""

    status: int
    out: str
    err: str


Line = Callable[..., Said]


class Bench:
    """A network with the service, and who announces."""

    def __init__(self, network: Network, client: Asking, folder: Path) -> None:
        self.network, self.client, self._file = network, client, folder / "params.db"
        self.service = self.serve()

    def serve(self) -> Process:
        """Start the service, on the same file again when it was there before, with everything announced."""
        service = self.service = serving(self.network, self.client, self._file)
        self.client.announce(arm(node="/arm"))
        self.client.announce(arm(node="/reference", parameters=ARM[:2]))
        for name in SETS[1:]:
            self.client.announce(arm(name, name, parameters=ARM[1:3]))
        return service


def line_of(bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Line:
    """``elea param VERB ...`` at the bench."""

    def run(verb: str, *words: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["elea", "param", verb, "--connect", bench.network.endpoint, *words])
        capsys.readouterr()
        status: Any = 0
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
        return Said(status, *capsys.readouterr())

    return run
