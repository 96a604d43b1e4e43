"""The goals of a robot, in order, and which comes next."""

from __future__ import annotations

from dataclasses import dataclass

from services.waypoint import WaypointParameters


@dataclass(frozen=True, slots=True)
class Goal:
    """A point [m] to stop on, and the heading [rad] to take there; None leaves the heading free."""

    x: float
    y: float
    yaw: float | None = None


ORIGIN = Goal(0.0, 0.0)
"""Stands for the goal where there is none."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Goals to reach one after the other; an endless plan begins again after the last."""

    goals: tuple[Goal, ...] = ()
    endless: bool = False

    @classmethod
    def of(cls, p: WaypointParameters) -> Plan:
        """The list of the parameters, written out for all its laps, with the final heading on its last goal."""
        goals = tuple(Goal(x, y) for x, y in p.goals) * max(1, p.laps)
        if goals and p.final_yaw is not None and p.laps:
            goals = (*goals[:-1], Goal(goals[-1].x, goals[-1].y, p.final_yaw))
        return cls(goals, endless=p.laps == 0)

    def after(self, index: int) -> int | None:
        """Index of the goal that follows ``index``; None when that was the last."""
        if index + 1 < len(self.goals):
            return index + 1
        return 0 if self.endless else None

    def before(self, index: int) -> Goal | None:
        """The goal that the robot comes from on its way to ``index``; None on the first leg of all."""
        return self.goals[index - 1] if index > 0 or self.endless else None
