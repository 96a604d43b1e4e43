"""From a robot's entry and its URDF to the terms on which its joints take efforts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from models.limits import read_limits
from services.runtime.errors import BadInput, unknown
from services.sim import RobotEntry
from services.sim.joints.effort import Rule


def rule_of(entry: RobotEntry) -> Rule:
    """How efforts on the joints of a robot become one."""
    asked = entry.joint_parameters
    return Rule(asked.effort_mode, asked.effort_clamp, asked.velocity_rule)


def doubts(entry: RobotEntry) -> Iterator[str]:
    """What the URDF of a robot says of its joints that is hardly meant so, one warning each."""
    gazebo = entry.joint_parameters.velocity_rule == "gazebo"
    for joint, limits in read_limits(entry.model).items():
        if limits.velocity == 0:
            meant = (
                'is a limit (velocity_rule = "gazebo"): once the joint moves, no effort acts along its motion'
                if gazebo
                else 'is taken as unspecified; velocity_rule = "gazebo" makes a limit of it'
            )
            yield f"joint {joint}: the URDF's velocity limit of 0 {meant}"
        if limits.effort == 0:
            yield f"joint {joint}: the URDF's effort limit is 0: no effort will move it"
    if entry.joint_parameters.effort_mode == "sum":
        yield (
            'effort_mode = "sum": jobs that overlap add up, as in Gazebo. A controller whose jobs last longer than its '
            "period multiplies its gains"
        )


def positions(model: str, joints: Mapping[str, float]) -> None:
    """Check positions [rad or m] against the joints of a model and their limits; raises BadInput."""
    known = read_limits(model)
    for joint, position in joints.items():
        if joint not in known:
            raise unknown("joint", joint, known, model)
        lower, upper = known[joint].lower, known[joint].upper
        if not (lower is None or lower <= position) or not (upper is None or position <= upper):
            raise BadInput(f"joint {joint} = {position:g}: its limits are {lower:g} and {upper:g}")
        if position != position or abs(position) > 1e6:
            raise BadInput(f"joint {joint} = {position}: no position")
