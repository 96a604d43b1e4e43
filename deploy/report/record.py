"""The records of report.json, schema 1; README.md beside this file documents every key."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from messages.parameters import Origin, Value
from services.grader.records import Ended, Figures, Measurements

SCHEMA: Literal[1] = 1
REPORT_FILE = "report.json"
PICTURE_FILE = "report.png"


def _text(text: str, unit: str | None = None) -> Meta:
    return Meta(description=text, extra_json_schema={"unit": unit} if unit else None)


def _positive(text: str, unit: str | None = None) -> Meta:
    return Meta(ge=0, description=text, extra_json_schema={"unit": unit} if unit else None)


class Effective(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter at the end of the run."""

    value: Annotated[Value, _text("its value")]
    origin: Annotated[Origin, _text("where it comes from; run: it was set for this run alone, on the way")]


class RunFacts(msgspec.Struct, frozen=True, kw_only=True):
    """What the supervisor knows of a run and the grader does not."""

    fleet: str
    mode: str
    seed: int
    version: str
    wall_seconds: float
    restarts: int = 0
    started: str = ""
    notes: tuple[str, ...] = ()
    parameters: dict[str, dict[str, Effective]] = {}


class RunFigures(msgspec.Struct, frozen=True, kw_only=True):
    """The run as a whole."""

    fleet: Annotated[str, _text("name of the fleet")]
    mode: Annotated[str, _text("lockstep, real or free")]
    ended: Annotated[Ended, _text("goals: all robots finished; duration: time was up; stopped: from outside")]
    started: Annotated[str, _text("wall-clock time of the start, ISO 8601; empty when not known")]
    sim_seconds: Annotated[float, _positive("simulation time measured", "s")]
    wall_seconds: Annotated[float, _positive("wall time that it took", "s")]
    real_time_factor: Annotated[float, _positive("sim_seconds / wall_seconds")]
    seed: Annotated[int, _text("seed of all random numbers of the run")]
    version: Annotated[str, _text("version of Elea")]
    trajectory_hash: Annotated[str, _text("SHA-256 over all ground-truth samples of all robots, hexadecimal")]
    messages_lost: Annotated[int, _positive("messages that the fleet's processes missed, by the gaps in their numbers")]
    onlookers_lost: Annotated[
        dict[str, Annotated[int, Meta(ge=1)]],
        _text("the same of each node on which no run depends, as panels and tools; those that missed none left out"),
    ]
    restarts: Annotated[int, _positive("processes restarted during the run")]


class Check(msgspec.Struct, frozen=True, kw_only=True):
    """One figure against one bound."""

    name: Annotated[str, _text("the figure: its key, behind the robot's name and a dot if it is a robot's")]
    value: Annotated[float | int | None, _text("what was measured, in the unit of the key; null when nothing was")]
    kind: Annotated[Literal["min", "max"], _text("whether the bound is the least or the largest good value")]
    bound: Annotated[float | int, _text("the bound, in the unit of the key")]
    ok: bool


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """report.json."""

    schema: Annotated[Literal[1], _text("version of this layout; it grows when a key changes its meaning or goes")]
    ok: Annotated[bool, _text("whether every check holds")]
    run: RunFigures
    robots: dict[str, Figures]
    checks: tuple[Check, ...]
    parameters: Annotated[
        dict[str, dict[str, Effective]], _text("live parameters that are not at their defaults, by set and name")
    ]
    notes: Annotated[tuple[str, ...], _text("what is off by design or by its configuration, and why, in words")]


def run_figures(facts: RunFacts, measured: Measurements) -> RunFigures:
    """The run's figures out of both sources."""
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
    )
