"""The state service: a robot's links on /tf and /tf_static, from its URDF and joint states, and joint states merged.

It is ROS's robot_state_publisher and joint_state_publisher in one. The simulation tells the frames of its own models
itself, from the same URDFs and without another process; this service is for robots that come from elsewhere, and for
robots of a fleet whose base has ``enable_link_tf = false``, so that each frame has one publisher.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service

RATE_HZ = 50
"""Of simulation time: how often it looks; a joint's transform is never told more often."""


_FIXED = {"live": False}


class StateParameters(Parameters, frozen=True, kw_only=True):
    """Which robots, whence their URDF, and where their joint states come from; names as in ROS."""

    robots: Annotated[
        tuple[str, ...],
        Meta(description="namespaces of several robots, served by this process; its own when empty", extra=_FIXED),
    ] = ()
    model: Annotated[str, Meta(description="a robot of models/; empty: see urdf", extra=_FIXED)] = ""
    urdf: Annotated[str, Meta(description="a URDF file; empty: the latched topic robot_description", extra=_FIXED)] = ""
    frame_prefix: Annotated[
        str | None,
        Meta(description="before every frame but those with a leading slash; the namespace by default", extra=_FIXED),
    ] = None
    publish_frequency: Annotated[
        float,
        Meta(gt=0, le=RATE_HZ, description="at most, of each joint's transform", extra={"unit": "Hz", "live": False}),
    ] = 50.0
    ignore_timestamp: Annotated[bool, Meta(description="tell transforms however soon after the last", extra=_FIXED)] = (
        False
    )

    source_list: Annotated[
        tuple[str, ...],
        Meta(description="topics with parts of the joint states, merged into joint_states", extra=_FIXED),
    ] = ()
    publish_default_positions: Annotated[
        bool, Meta(description="joints without a source stand at zero, or amid limits that exclude it", extra=_FIXED)
    ] = False
    publish_default_velocities: Annotated[bool, Meta(description="their velocity is 0, not left out", extra=_FIXED)] = (
        False
    )
    publish_default_efforts: Annotated[bool, Meta(description="their effort is 0, not left out", extra=_FIXED)] = False
    zeros: Annotated[
        tuple[str, ...], Meta(description="other positions instead of zero, as elbow=0.5", extra=_FIXED)
    ] = ()
    dependent_joints: Annotated[
        tuple[str, ...],
        Meta(description="joints that follow others, as left=right, or left=right*-1+0.1", extra=_FIXED),
    ] = ()
    use_mimic_tags: Annotated[bool, Meta(description="joints follow others as the URDF says", extra=_FIXED)] = True
    use_smallest_joint_limits: Annotated[
        bool, Meta(description="soft limits of the safety controller count", extra=_FIXED)
    ] = True
    rate: Annotated[
        float, Meta(gt=0, le=RATE_HZ, description="of merged joint states", extra={"unit": "Hz", "live": False})
    ] = 10.0
    delta: Annotated[
        float, Meta(ge=0, le=10, description="joints without a source go to and fro by this, each time", extra=_FIXED)
    ] = 0.0


SERVICE = Service(
    name="state",
    about="Tells a robot's links on /tf from its URDF and joint states, and merges joint states",
    run="services.state.loop:run",
    rate=RATE_HZ,
    parameters=StateParameters,
)
