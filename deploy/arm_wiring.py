"""What an arm, its reference and the grader are told of each other: the joint, its range and its weight."""

from __future__ import annotations

import math
from typing import Any

from deploy.fleet import Fleet, Member, Robot
from messages.topics import CONTROL_STATE
from models.figures import read_model
from models.limits import read_limits
from models.pendulum import pendulum
from services.arm import ArmParameters

AFTER_S = 1.0
"""A run ends by goals so long after the last scheduled change at the earliest: it must have been seen."""


def jointed(robot: Robot) -> bool:
    """Whether a robot is an arm: one that stands still and has a joint with a range."""
    return read_model(robot.model).wheels is None and bool(_joints(robot))


def moved(robot: Robot) -> str:
    """The joint of an arm that is controlled: the first that has a range, from its root on."""
    return next(iter(_joints(robot)))


def arm_wired(kind: str, fleet: Fleet, robot: Robot | None) -> dict[str, Any]:
    """The parameters of an arm's controller or reference; outside any robot, those of the fleet's only arm."""
    arms = [each for each in fleet.robot if jointed(each)]
    if robot is None and len(arms) == 1:
        robot = arms[0]
    if kind not in ("arm", "reference") or robot is None or not jointed(robot):
        return {}
    joint = moved(robot)
    lower, upper = _joints(robot)[joint]
    ends = {"lower": math.degrees(lower), "upper": math.degrees(upper)}
    if kind == "reference":
        return ends
    weight = pendulum(robot.model, joint)
    return {
        "joint": joint,
        **ends,
        "gravity_torque": weight.torque,
        "gravity_rest": math.degrees(weight.rest),
        "inertia": weight.inertia,
    }


def graded_arms(fleet: Fleet) -> list[dict[str, Any]]:
    """The arms of a fleet as the grader knows them."""
    return [_graded(fleet, each) for each in fleet.robot if jointed(each)]


def states(fleet: Fleet) -> list[str]:
    """For each robot, where the controller of its joint tells its state; empty for those that are no arm."""
    arms = {each["name"]: each["state"] for each in graded_arms(fleet)}
    return [arms.get(each.name, "") for each in fleet.robot]


def not_before(fleet: Fleet) -> float:
    """When the run may end by goals, s."""
    return max((each.at + AFTER_S for each in fleet.change), default=0.0)


def _graded(fleet: Fleet, robot: Robot) -> dict[str, Any]:
    members = [*robot.services, *(each for _, each in fleet.shared(robot)), *fleet.service]
    member = next((each for each in members if each.kind == "arm"), Member(kind="arm"))
    return {
        "name": robot.name,
        "joint": member.parameters.get("joint", moved(robot)),
        "saturation": member.parameters.get("saturation", ArmParameters().saturation),
        "state": member.remap.get(CONTROL_STATE.name, CONTROL_STATE.name),
    }


def _joints(robot: Robot) -> dict[str, tuple[float, float]]:
    """The joints of a robot that have a range, rad."""
    limits = read_limits(robot.model).items()
    return {
        name: (each.lower, each.upper)
        for name, each in limits
        if each.kind == "revolute" and each.lower is not None and each.upper is not None and each.lower < each.upper
    }
