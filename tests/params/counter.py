"""A desk in memory or on a file, with what it tells and logs."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from messages.parameters import HistoryOf, ParameterSet, ParameterValues, ResetParameters, SetParameters, UndoParameters
from services.params.desk import Desk
from services.params.store import opened
from services.runtime.log import Log
from tests.params.sets import plain, values

SET = "/robot_control"


class Counter:
    """A desk, what it told, and what it logged."""

    def __init__(self, desk: Desk, told: list[Any], out: io.StringIO, alive: set[str], ended: list[str]) -> None:
        self.desk, self.told, self.out, self.alive, self.ended = desk, told, out, alive, ended

    def set(self, clamp: bool = False, run: bool = False, request: str = "", **given: Any) -> ParameterValues:
        return self.desk.set(SetParameters(set=SET, values=values(**given), clamp=clamp, run=run, id=request, who="me"))

    def reset(self, *names: str) -> ParameterValues:
        return self.desk.reset(ResetParameters(set=SET, names=names))

    def undo(self, request: str = "") -> ParameterValues:
        return self.desk.undo(UndoParameters(set=SET, id=request))

    def undo_of(self, revision: int) -> ParameterValues:
        return self.desk.undo(UndoParameters(set=SET, revision=revision))

    def get(self) -> dict[str, Any]:
        return plain(self.record())

    def record(self) -> ParameterValues:
        return self.desk.get(ParameterSet(set=SET))

    def origins(self) -> dict[str, str]:
        return {each.name: each.origin for each in self.record().values}

    def history(self) -> list[Any]:
        return list(self.desk.history(HistoryOf(set=SET)).changes)


@contextmanager
def counter(file: str = "") -> Iterator[Counter]:
    with opened(file) as store:
        told: list[Any] = []
        out, alive = io.StringIO(), {"/arm", "/reference"}
        ended: list[str] = []
        desk = Desk(store, told.append, Log("/params", out=out), lambda: 1_500_000_000, lambda: alive, ended.append)
        yield Counter(desk, told, out, alive, ended)
