"""A parameter server on a file, with a set of many parameters, and its content."""

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
from services.params.server import ParameterServer
from services.params.store import Store, open_store
from services.runtime.log import Log
from tests.services.params.parameter_client import ARM_PARAMETERS, arm_announcement, assignments, value_dict

SET = "/robot_control"


MANY_PARAMETERS = (
    *ARM_PARAMETERS,
    ParameterDescription(name="text", type="str", default=""),
    *(ParameterDescription(name=f"p{i}", default=0.0) for i in range(120)),
)


@contextmanager
def server_on_file(file: Path | str) -> Iterator[ParameterServer]:
    with open_store(str(file)) as store:
        yield server_on_store(store)


def server_on_store(store: Store) -> ParameterServer:
    made = ParameterServer(
        store, lambda news: None, Log("/params", "fatal"), lambda: 0, lambda: {"/arm", "/reference"}, lambda name: None
    )
    made.announce(arm_announcement(parameters=MANY_PARAMETERS))
    return made


def set_values(at: ParameterServer, **given: Any) -> None:
    at.set(SetParameters(set=SET, values=assignments(**given), id=str(given), who="tester"))


def read_values(at: ParameterServer) -> tuple[dict[str, Any], tuple[ParameterChange, ...]]:
    return value_dict(at.get(ParameterSet(set=SET))), at.history(HistoryOf(set=SET)).changes
