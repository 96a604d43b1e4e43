"""The loop of the static transform service: publishes one latched message, also for late subscribers."""

from __future__ import annotations

import math

from messages.errors import BadInput
from messages.geometry import Quaternion, Transform, TransformStamped, Vector3
from messages.se3 import quaternion_from_rpy
from messages.std import Header
from messages.tf import TFMessage
from messages.topics import TF_STATIC
from services.runtime.context import Context
from services.static_transform import StaticTransformParameters

LENGTH_TOLERANCE = 0.01
"""Maximum deviation of a quaternion's norm from 1."""


def run(ctx: Context[StaticTransformParameters]) -> None:
    """Publish at once, even before or without simulation time, and stay until asked to stop."""
    ctx.publish(TF_STATIC, TFMessage(transforms=(static_transform(ctx.params),)))
    ctx.node.clock_patience_s = math.inf
    for _ in ctx.ticks():
        pass


def static_transform(p: StaticTransformParameters) -> TransformStamped:
    """Return the transform of the parameters; raises BadInput for an invalid one."""
    parent, child = p.frame_id.lstrip("/"), p.child_frame_id.lstrip("/")
    if not parent or not child:
        raise BadInput("static_transform: both frames need a name: frame_id=PARENT child_frame_id=CHILD")
    if parent == child:
        raise BadInput(
            f"static_transform: frame_id and child_frame_id are both {parent!r}: a frame is not its own parent"
        )
    if p.quaternion and (p.roll, p.pitch, p.yaw) != (0.0, 0.0, 0.0):
        raise BadInput("static_transform: both a quaternion and angles are given: leave one of them out")
    x, y, z, w = _rotation(p)
    return TransformStamped(
        header=Header(frame_id=parent),
        child_frame_id=child,
        transform=Transform(translation=Vector3(x=p.x, y=p.y, z=p.z), rotation=Quaternion(x=x, y=y, z=z, w=w)),
    )


def _rotation(p: StaticTransformParameters) -> tuple[float, float, float, float]:
    if not p.quaternion:
        return quaternion_from_rpy(p.roll, p.pitch, p.yaw)
    length = math.hypot(*p.quaternion)
    if len(p.quaternion) != 4 or abs(length - 1) > LENGTH_TOLERANCE:
        raise BadInput(
            f"static_transform: quaternion = {list(p.quaternion)} is not a rotation: it needs four numbers x, y, z, w "
            f"with norm 1, and has {len(p.quaternion)} with norm {length:.3f}"
        )
    x, y, z, w = (each / length for each in p.quaternion)
    return x, y, z, w
