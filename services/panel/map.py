"""The channels of the map: where the robots are, and what else is told of each."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from models import MODELS
from models.figures import read_model
from services.panel.channel import as_json
from services.panel.estop import Stops
from services.panel.robots import Robot, Robots, Spot

MOST_GOALS = 200
"""Goals of a plan that are shown."""


class PosesChannel:
    """Tells the poses with every turn in which one came: ``[x, y, yaw, x, y, yaw, v, w]``, true then estimated."""

    period, streams = 0.04, False

    def __init__(self, robots: Robots) -> None:
        self._robots = robots

    @property
    def version(self) -> int:
        """The motions of the robots."""
        return self._robots.moves

    def follow(self, wanted: bool) -> None:
        """The hub lets the robots be followed."""

    def turn(self, now: float) -> None:
        """The hub turns the robots."""

    def news(self, since: int) -> str | None:
        poses = {}
        for robot in self._robots.found.values():
            if robot.truth is not None:
                estimate = robot.estimate or robot.truth
                poses[robot.namespace] = [round(each, 4) for each in (*robot.truth, *estimate, *robot.speed)]
        return as_json("poses", at=poses)


class RobotsChannel:
    """Tells what each robot is, obeys, and is about, when any of it changes."""

    period, streams = 0.1, False

    def __init__(self, robots: Robots, stops: Stops) -> None:
        self._robots, self._stops = robots, stops

    @property
    def version(self) -> int:
        """The robots' and the stops'."""
        return self._robots.version + self._stops.version

    def follow(self, wanted: bool) -> None:
        """The hub lets the robots be followed."""

    def turn(self, now: float) -> None:
        """The hub turns the robots."""

    def news(self, since: int) -> str | None:
        robots = self._robots
        listed = [{**described(each, self._stops), "colour": robots.colour(each)} for each in robots.found.values()]
        return as_json("robots", robots=listed, all_stopped=self._stops.asked(""))


@lru_cache(64)
def _radius(model: str) -> float:
    """How far a robot reaches, m; 0 for a model that is not of this project."""
    return round(read_model(model).radius, 3) if model in MODELS else 0.0


def described(robot: Robot, stops: Stops) -> dict[str, Any]:
    """A robot as pages show it; goals lie in the world."""
    base, goal, plan = robot.base, robot.goal, robot.plan
    goals = plan.poses[:MOST_GOALS] if plan is not None else ()
    stopped = stops.stopped(robot.namespace)
    return {
        "ns": robot.namespace,
        "model": base.model if base else "",
        "radius": _radius(base.model) if base else 0.0,
        "drives": bool(robot.drives),
        "stops": robot.stops,
        "goals": robot.takes_goals,
        "source": base.source if base else "",
        "timed_out": base.timed_out if base else False,
        "stopped": (base is not None and base.e_stopped) if stopped is None else stopped,
        "stopped_by": stops.others(robot.namespace),
        "asked": stops.asked(robot.namespace),
        "colliding": base.colliding if base else False,
        "collisions": base.collisions if base else 0,
        "state": goal.state if goal else "",
        "index": goal.index if goal else 0,
        "plan": [
            list(robot.origin.of(Spot(p.pose.position.x, p.pose.position.y, p.pose.orientation.yaw)))[:2] for p in goals
        ],
    }
