"""The configuration of a robot's joints, from its parameters and its URDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import msgspec

from models import display_name
from models.urdf import read_joint_limits
from services.runtime.errors import BadInput, unknown_name
from services.sim.joints.effort_controller import EffortRule
from services.sim.parameters import JointParameters
from services.sim.physics.world import JointFriction


@dataclass(frozen=True)
class JointConfig:
    """The rule by which efforts on joints are combined, and the friction of each joint.

    ``warnings`` name values of URDF and parameters that are probably mistakes.
    """

    effort_rule: EffortRule
    joint_friction: Mapping[str, JointFriction]
    warnings: tuple[str, ...]


def joint_config(model: str, parameters: JointParameters) -> JointConfig:
    """Return the joint configuration of a robot of the model ``model``."""
    rule = EffortRule(parameters.effort_mode, parameters.effort_clamp, parameters.velocity_rule)
    damping, friction = parameters.damping, parameters.friction
    joint_friction = {
        joint: JointFriction(
            limits.damping if damping is None else damping, limits.friction if friction is None else friction
        )
        for joint, limits in read_joint_limits(model).items()
    }
    return JointConfig(rule, joint_friction, tuple(_warnings(model, rule)))


def with_urdf_defaults(model: str, parameters: JointParameters) -> JointParameters:
    """Fill in the URDF's values where the parameters have None and all joints have the same value."""
    values = {}
    for name in ("damping", "friction"):
        every = {getattr(limits, name) for limits in read_joint_limits(model).values()}
        if getattr(parameters, name) is None and len(every) == 1:
            values[name] = every.pop()
    return msgspec.structs.replace(parameters, **values)


def check_positions(model: str, joints: Mapping[str, float]) -> None:
    """Check positions [rad or m] against a model's joints and their limits; raises BadInput."""
    known = read_joint_limits(model)
    for joint, position in joints.items():
        if joint not in known:
            raise unknown_name("joint", joint, known, display_name(model))
        lower, upper = known[joint].lower, known[joint].upper
        if not (lower is None or lower <= position) or not (upper is None or position <= upper):
            raise BadInput(f"joint {joint} = {position:g}: its limits are {lower:g} and {upper:g}")
        if position != position or abs(position) > 1e6:
            raise BadInput(f"joint {joint} = {position}: not a valid position")


def _warnings(model: str, rule: EffortRule) -> Iterator[str]:
    for joint, limits in read_joint_limits(model).items():
        if limits.velocity == 0:
            effect = (
                'is a limit (velocity_rule = "gazebo"): once the joint moves, no effort acts along its motion'
                if rule.velocity == "gazebo"
                else 'counts as unspecified; velocity_rule = "gazebo" makes it a limit'
            )
            yield f"joint {joint}: the URDF's velocity limit of 0 {effect}"
        if limits.effort == 0:
            yield f"joint {joint}: the URDF's effort limit is 0: no effort will move it"
    if rule.mode == "sum":
        yield (
            'effort_mode = "sum": jobs that overlap add up, as in Gazebo. A controller whose jobs last longer than its '
            "period multiplies its gains"
        )
