"""A desk on a file of parameters, with a set of many, and what lies in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from messages.parameters import (
    HistoryOf,
    ParameterChange,
    ParameterDescription,
    ParameterSet,
    SetParameters,
)
from services.params.desk import Desk
from services.params.store import Store, opened
from services.runtime.log import Log
from tests.params.sets import ARM, arm, plain, values

SET = "/robot_control"


WIDE = (
    *ARM,
    ParameterDescription(name="text", type="str", default=""),
    *(ParameterDescription(name=f"p{i}", default=0.0) for i in range(120)),
)


@contextmanager
def desk(file: Path | str) -> Iterator[Desk]:
    with opened(str(file)) as store:
        yield of(store)


def of(store: Store) -> Desk:
    made = Desk(
        store, lambda news: None, Log("/params", "fatal"), lambda: 0, lambda: {"/arm", "/reference"}, lambda name: None
    )
    made.announce(arm(parameters=WIDE))
    return made


def put(at: Desk, **given: Any) -> None:
    at.set(SetParameters(set=SET, values=values(**given), id=str(given), who="tester"))


def seen(at: Desk) -> tuple[dict[str, Any], tuple[ParameterChange, ...]]:
    return plain(at.get(ParameterSet(set=SET))), at.history(HistoryOf(set=SET)).changes
