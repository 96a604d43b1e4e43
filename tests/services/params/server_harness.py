"""A parameter server in memory or on a file, with its publications and log."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from messages.parameters import HistoryOf, ParameterSet, ParameterValues, ResetParameters, SetParameters, UndoParameters
from services.params.server import ParameterServer
from services.params.store import open_store
from services.runtime.log import Log
from tests.services.params.parameter_client import assignments, value_dict

SET = "/robot_control"


class ServerHarness:
    """A parameter server, its publications and its log."""

    def __init__(
        self, server: ParameterServer, told: list[Any], out: io.StringIO, alive: set[str], ended: list[str]
    ) -> None:
        self.server, self.published, self.log, self.alive, self.ended = server, told, out, alive, ended

    def set(self, clamp: bool = False, run: bool = False, request: str = "", **given: Any) -> ParameterValues:
        return self.server.set(
            SetParameters(set=SET, values=assignments(**given), clamp=clamp, run=run, id=request, who="me")
        )

    def reset(self, *names: str) -> ParameterValues:
        return self.server.reset(ResetParameters(set=SET, names=names))

    def undo(self, request: str = "") -> ParameterValues:
        return self.server.undo(UndoParameters(set=SET, id=request))

    def undo_revision(self, revision: int) -> ParameterValues:
        return self.server.undo(UndoParameters(set=SET, revision=revision))

    def get(self) -> dict[str, Any]:
        return value_dict(self.record())

    def record(self) -> ParameterValues:
        return self.server.get(ParameterSet(set=SET))

    def origins(self) -> dict[str, str]:
        return {each.name: each.origin for each in self.record().values}

    def history(self) -> list[Any]:
        return list(self.server.history(HistoryOf(set=SET)).changes)


@contextmanager
def server_harness(file: str = "") -> Iterator[ServerHarness]:
    with open_store(file) as store:
        told: list[Any] = []
        out, alive = io.StringIO(), {"/arm", "/reference"}
        ended: list[str] = []
        server = ParameterServer(
            store, told.append, Log("/params", out=out), lambda: 1_500_000_000, lambda: alive, ended.append
        )
        yield ServerHarness(server, told, out, alive, ended)
