"""The state service: a robot's links on /tf and /tf_static, from its URDF and joint states, and joint states merged.

It is ROS's robot_state_publisher and joint_state_publisher in one. The simulation tells the frames of its own models
itself, from the same URDFs and without another process; this service is for robots that come from elsewhere, and for
robots of a fleet whose base has ``enable_link_tf = false``, so that each frame has one publisher.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime import Parameters, Service, param

RATE_HZ = 50
"""Of simulation time: how often it looks; a joint's transform is never told more often."""


class StateParameters(Parameters, frozen=True, kw_only=True):
    """Which robots, whence their URDF, and where their joint states come from; names as in ROS."""

    robots: tuple[str, ...] = param(
        (), text="namespaces of several robots, served by this process; its own when empty", live=False
    )
    model: str = param("", text="a robot of models/; empty: see urdf", live=False)
    urdf: str = param("", text="a URDF file; empty: the latched topic robot_description", live=False)
    frame_prefix: str | None = param(
        None, text="before every frame but those with a leading slash; the namespace by default", live=False
    )
    publish_frequency: Annotated[
        float,
        Meta(gt=0, le=RATE_HZ, description="at most, of each joint's transform", extra={"unit": "Hz", "live": False}),
    ] = 50.0
    ignore_timestamp: bool = param(False, text="tell transforms however soon after the last", live=False)

    source_list: tuple[str, ...] = param(
        (), text="topics with parts of the joint states, merged into joint_states", live=False
    )
    publish_default_positions: bool = param(
        False, text="joints without a source stand at zero, or amid limits that exclude it", live=False
    )
    publish_default_velocities: bool = param(False, text="their velocity is 0, not left out", live=False)
    publish_default_efforts: bool = param(False, text="their effort is 0, not left out", live=False)
    zeros: tuple[str, ...] = param((), text="other positions instead of zero, as elbow=0.5", live=False)
    dependent_joints: tuple[str, ...] = param(
        (), text="joints that follow others, as left=right, or left=right*-1+0.1", live=False
    )
    use_mimic_tags: bool = param(True, text="joints follow others as the URDF says", live=False)
    use_smallest_joint_limits: bool = param(True, text="soft limits of the safety controller count", live=False)
    rate: Annotated[
        float, Meta(gt=0, le=RATE_HZ, description="of merged joint states", extra={"unit": "Hz", "live": False})
    ] = 10.0
    delta: float = param(0.0, 0, 10, "", "joints without a source go to and fro by this, each time", live=False)


SERVICE = Service(
    name="state",
    about="Tells a robot's links on /tf from its URDF and joint states, and merges joint states",
    run="services.state.loop:run",
    rate=RATE_HZ,
    parameters=StateParameters,
)
