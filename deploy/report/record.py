"""The records of report.json, schema 1; README.md beside this file documents every key."""

from __future__ import annotations

import json
from inspect import cleandoc
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from messages.base import DECODE_ERRORS
from messages.errors import list_names
from messages.parameters import Origin, Value
from services.grader.records import EndReason, Figures, Measurements

SCHEMA: Literal[1] = 1
REPORT_FILE = "report.json"
PICTURE_FILE = "report.png"


def _text(text: str, unit: str | None = None) -> Meta:
    return Meta(description=text, extra_json_schema={"unit": unit} if unit else None)


def _positive(text: str, unit: str | None = None) -> Meta:
    return Meta(ge=0, description=text, extra_json_schema={"unit": unit} if unit else None)


class EffectiveParameter(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter at the end of the run."""

    value: Annotated[Value, _text("its value")]
    origin: Annotated[Origin, _text("its source; run: set for this run only, while it ran")]


class ChangeFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A scheduled change of parameters, and its outcome."""

    at_s: Annotated[float, _positive("simulation time for which it was scheduled", "s")]
    set: Annotated[str, _text("the set of parameters")]
    values: Annotated[dict[str, Value], _text("the values, by the names of the parameters")]
    made: Annotated[bool | None, _text("whether it was made; null when the run ended before its time")]
    made_at_s: Annotated[float | None, _text("simulation time at which it was made", "s")]
    reason: Annotated[str, _text("why it was not made; empty when it was")]


class RunFacts(msgspec.Struct, frozen=True, kw_only=True):
    """The supervisor's facts about a run; ``failed`` are the nodes of processes that exited with an error."""

    fleet: str
    mode: str
    seed: int
    version: str
    wall_seconds: float
    restarts: int = 0
    started: str = ""
    factor: float = 1.0
    engine: str = ""
    topology: str = ""
    changes: tuple[ChangeFigures, ...] = ()
    absent: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    lag_s: float = 0.0
    notes: tuple[str, ...] = ()
    parameters: dict[str, dict[str, EffectiveParameter]] = {}
    checks: tuple[Check, ...] = ()


class RunFigures(msgspec.Struct, frozen=True, kw_only=True):
    """The run as a whole."""

    fleet: Annotated[str, _text("name of the fleet")]
    mode: Annotated[str, _text("lockstep or real; free in reports of earlier versions")]
    ended: Annotated[
        EndReason,
        _text("goals: all robots finished; duration: the time limit was reached; stopped: stopped from outside"),
    ]
    started: Annotated[str, _text("wall-clock time of the start, ISO 8601; empty when not known")]
    sim_seconds: Annotated[float, _positive("simulation time measured", "s")]
    wall_seconds: Annotated[float, _positive("wall time that it took", "s")]
    real_time_factor: Annotated[float, _positive("sim_seconds / wall_seconds")]
    seed: Annotated[int, _text("random seed of the run")]
    version: Annotated[str, _text("version of Elea")]
    trajectory_hash: Annotated[str, _text("SHA-256 over all ground-truth samples of all robots, hexadecimal")]
    messages_lost: Annotated[
        int,
        _positive("messages that the fleet's processes missed, from gaps in the sequence numbers"),
    ]
    onlookers_lost: Annotated[
        dict[str, Annotated[int, Meta(ge=1)]],
        _text(
            "messages missed by each node on which the run does not depend, e.g. panels and tools; nodes that missed "
            "none are left out"
        ),
    ]
    restarts: Annotated[int, _positive("processes restarted during the run")]
    members_lost: (
        Annotated[
            int,
            _positive(
                "nodes that lockstep continued without because they exited, did not answer or never joined; null "
                "without lockstep"
            ),
        ]
        | None
    ) = None
    members_left: Annotated[int, _positive("nodes that left lockstep before the end")] = 0
    changes_missed: Annotated[int, _positive("scheduled changes that were due but not made")] = 0
    nodes_absent: Annotated[int, _positive("nodes of the fleet that were not ready when time began")] = 0
    absent: Annotated[tuple[str, ...], _text("these nodes")] = ()
    engine: Annotated[str, _text("physics engine; empty in reports of earlier versions and without a simulation")] = ""
    topology: Annotated[
        str,
        _text(
            "direct: processes are connected to each other; star: to the router; empty in reports of earlier versions"
        ),
    ] = ""
    factor: Annotated[
        float, _positive("requested seconds of simulation per second of wall time; in real time only")
    ] = 1.0
    lag_s: Annotated[float, _positive("wall time by which the simulation fell behind, in real time", "s")] = 0.0
    ticks_missed: Annotated[
        dict[str, Annotated[int, Meta(ge=1)]],
        _text("ticks that each process missed because it was late, by node; in real time only"),
    ] = {}


class Check(msgspec.Struct, frozen=True, kw_only=True):
    """One figure against one bound."""

    name: Annotated[
        str,
        _text("KEY for a figure of the run, ROBOT.KEY for one of a robot, NODE.NAME for a service's own check"),
    ]
    value: Annotated[float | int | None, _text("the measured value, in the unit of the key; null when not measured")]
    kind: Annotated[Literal["min", "max"], _text("whether the bound is a minimum or a maximum")]
    bound: Annotated[float | int, _text("the bound, in the unit of the key")]
    ok: bool
    reason: Annotated[str, _text("reason given by the service for a check of its own; else empty")] = ""


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """report.json."""

    schema: Annotated[
        Literal[1],
        _text("version of this layout; incremented when a key changes its meaning or is removed"),
    ]
    ok: Annotated[bool, _text("whether every check holds")]
    run: RunFigures
    robots: dict[str, Figures]
    checks: tuple[Check, ...]
    parameters: Annotated[
        dict[str, dict[str, EffectiveParameter]],
        _text("live parameters that are not at their defaults, by set and name"),
    ]
    notes: Annotated[
        tuple[str, ...],
        _text("notes on deliberate errors, the configuration and the machine, in words"),
    ]
    changes: Annotated[tuple[ChangeFigures, ...], _text("the scheduled changes, in the order of their times")] = ()


def read_report(folder: Path) -> Report | None:
    """Return the report of a run; None if it is missing or unreadable."""
    try:
        return msgspec.json.decode((folder / REPORT_FILE).read_bytes(), type=Report)
    except (OSError, *DECODE_ERRORS):
        return None


def run_figures(facts: RunFacts, measured: Measurements) -> RunFigures:
    """Combine both sources into the run's figures."""
    lost, left = _members(facts, measured)
    return RunFigures(
        fleet=facts.fleet,
        mode=facts.mode,
        ended=measured.ended,
        started=facts.started,
        sim_seconds=measured.sim_seconds,
        wall_seconds=facts.wall_seconds,
        real_time_factor=measured.sim_seconds / facts.wall_seconds if facts.wall_seconds > 0 else 0.0,
        seed=facts.seed,
        version=facts.version,
        trajectory_hash=measured.trajectory_hash,
        messages_lost=measured.messages_lost,
        onlookers_lost=measured.onlookers_lost,
        restarts=facts.restarts,
        members_lost=None if measured.members_lost is None else len(lost),
        members_left=len(left),
        changes_missed=sum(each.made is False for each in facts.changes),
        nodes_absent=len(facts.absent),
        absent=facts.absent,
        engine=facts.engine,
        topology=facts.topology,
        factor=facts.factor,
        lag_s=facts.lag_s,
        ticks_missed=measured.ticks_missed,
    )


MAX_NAMED = 10
"""Maximum number of names in one line about the run."""


def member_notes(facts: RunFacts, measured: Measurements) -> tuple[str, ...]:
    """Return notes on the members that lockstep lost, and on those that left it."""
    lost, left = _members(facts, measured)
    found = []
    if lost:
        found.append(f"lockstep went on without {list_names(lost, MAX_NAMED)}: the run does not repeat")
    if left:
        found.append(f"{list_names(left, MAX_NAMED)} left lockstep before the end")
    return tuple(found)


def loss_notes(measured: Measurements) -> tuple[str, ...]:
    """Return a note on which nodes lost messages of which topics, most first."""
    lost = [(count, node, topic) for node, topics in measured.losses.items() for topic, count in topics.items()]
    lost.sort(key=lambda each: (-each[0], *each[1:]))
    listed = list_names([f"{node} lost {count} of {topic}" for count, node, topic in lost], MAX_NAMED)
    return (f"messages lost: {listed}",) if lost else ()


def _members(facts: RunFacts, measured: Measurements) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the members that lockstep lost, and those that left it; one that failed counts as
    lost, even if it left.
    """
    lost, left = measured.members_lost or (), measured.members_left
    failed = tuple(each for each in left if each in facts.failed and each not in lost)
    return (*lost, *failed), tuple(each for each in left if each not in facts.failed)


SCHEMA_FILE = Path(__file__).with_name("schema.json")
"""The schema file, as printed by ``python -m deploy.report.record``."""


def report_schema() -> dict[str, Any]:
    """Return the JSON Schema 2020-12 of a report."""
    schema = msgspec.json.schema(Report)
    for each in schema["$defs"].values():
        if "description" in each:  # a docstring, whose indentation Python 3.13 removes
            each["description"] = cleandoc(each["description"])
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Elea run report", **schema}


def schema_text() -> str:
    """Return the contents of schema.json."""
    return json.dumps(report_schema(), indent=2) + "\n"


if __name__ == "__main__":
    print(schema_text(), end="")
