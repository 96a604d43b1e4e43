"""Checks of a run: figures against the bounds of a fleet file, and checks published by services."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Literal

import msgspec

from deploy.report.record import Check, RunFigures
from messages.elea import Check as Stated
from services.grader.records import ArmFigures, Figures, RobotFigures
from services.runtime.errors import BadInput, unknown_name

Value = float | int | None


class Bound(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The minimum and maximum of a figure; at least one of them is set."""

    min: float | int | None = None
    max: float | int | None = None


Bounds = Mapping[str, float | int | Bound]
"""By key of a robot (for every robot) or of the run; a bare number is the maximum."""

DEFAULT_BOUNDS: Bounds = {"collisions": 0, "messages_lost": 0}
"""Default bounds of every run; in addition, every robot must have samples and reach all its points."""
LOCKSTEP_DEFAULT_BOUNDS: Bounds = {"members_lost": 0}
"""Additional default bounds of runs in lockstep."""

_FAULT_COUNTS = ("changes_missed", "nodes_absent")
"""Counts of faults in a run: each that is not 0 adds a missed check."""

_NOT_BOUNDED = (
    *("points_reached", "points_reached_at", "points_closest_m", "corners", "steps", "min_clearance_at_s"),
    "min_clearance_to",
)
_FIELDS = (*msgspec.structs.fields(RobotFigures), *msgspec.structs.fields(ArmFigures))
ROBOT_KEYS = tuple(dict.fromkeys(each.name for each in _FIELDS if each.name not in _NOT_BOUNDED))
RUN_KEYS = (
    *("sim_seconds", "wall_seconds", "real_time_factor", "messages_lost", "restarts"),
    *("members_lost", "members_left", "changes_missed", "nodes_absent", "lag_s"),
)
KEYS = tuple(dict.fromkeys((*ROBOT_KEYS, "points_reached", *RUN_KEYS)))


def check_bounds(bounds: Bounds, where: str) -> None:
    """Raise BadInput for a bound on an unknown figure, or without min and max; ``where`` is its place."""
    for name, bound in bounds.items():
        if name not in KEYS:
            raise unknown_name("figure", name, KEYS, where)
        if bound == Bound():
            raise BadInput(f"{where}.{name}: give min, max or both")


def check_figures(run: RunFigures, robots: Mapping[str, Figures], bounds: Bounds) -> tuple[Check, ...]:
    """Check every figure that has a bound.

    The fleet's ``bounds`` are checked whatever the run measured: a figure that was not measured misses its bound, and
    one that no robot has is missed once, under its bare name. A bound on a figure that only another kind of robot has
    does not apply to a robot. The default bounds, including that every point of a plan is reached, are checked where
    there is something to check.
    """
    found: list[Check] = []
    faults = {name: 0 for name in _FAULT_COUNTS if getattr(run, name)}
    defaults = {**faults, **DEFAULT_BOUNDS, **(LOCKSTEP_DEFAULT_BOUNDS if run.mode == "lockstep" else {})}
    of_robots = {name: bound for name, bound in {**defaults, **bounds}.items() if name not in RUN_KEYS}
    for robot, figures in robots.items():
        own: dict[str, float | int | Bound] = {"samples": Bound(min=1), **of_robots}
        if isinstance(figures, RobotFigures) and figures.points:
            own = {"points_reached": Bound(min=figures.points), **own}
        for name, bound in own.items():
            value = getattr(figures, name, None)
            if hasattr(figures, name) and (value is not None or name in bounds):
                found += _check_bound(f"{robot}.{name}", value, bound)
    for name in bounds:
        if name in of_robots and not any(hasattr(figures, name) for figures in robots.values()):
            found += _check_bound(name, None, bounds[name])
    for name, bound in {**defaults, **bounds}.items():
        if name in RUN_KEYS:
            found += _check_bound(name, getattr(run, name), bound)
    return tuple(found)


def _check_bound(name: str, value: Value, bound: float | int | Bound) -> Iterator[Check]:
    limits = bound if isinstance(bound, Bound) else Bound(max=bound)
    if limits.min is not None:
        yield _check(name, value, "min", limits.min)
    if limits.max is not None:
        yield _check(name, value, "max", limits.max)


def _check(name: str, value: Value, kind: Literal["min", "max"], bound: float | int) -> Check:
    return Check(name=name, value=value, kind=kind, bound=bound, ok=_holds(value, kind, bound))


def _holds(value: Value, kind: Literal["min", "max"], bound: float | int) -> bool:
    if value is None:
        return False
    return value >= bound if kind == "min" else value <= bound


def service_checks(stated_by_node: Mapping[str, Iterable[Stated]]) -> tuple[Check, ...]:
    """Return a check for each bound published by services, named ``NODE.name`` and sorted by node."""
    return tuple(
        made
        for node in sorted(stated_by_node)
        for stated in stated_by_node[node]
        for made in _service_check(f"{node}.{stated.name}", stated)
    )


def is_service_check(check: Check) -> bool:
    """Return whether a service published the check: its name then begins with that of a node."""
    return check.name.startswith("/")


def unknown_node_notes(nodes: Iterable[str]) -> tuple[str, ...]:
    """Return the note on nodes whose checks do not count."""
    listed = ", ".join(sorted(nodes))
    return (f"checks published by nodes outside the fleet are not counted: {listed}",) if listed else ()


def _service_check(name: str, stated: Stated) -> Iterator[Check]:
    value, reason = stated.value, stated.reason
    if stated.min is not None:
        ok = value is not None and value >= stated.min
        yield Check(name=name, value=value, kind="min", bound=stated.min, ok=ok, reason=reason)
    if stated.max is not None:
        ok = value is not None and value <= stated.max
        yield Check(name=name, value=value, kind="max", bound=stated.max, ok=ok, reason=reason)
