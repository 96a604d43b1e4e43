"""The state service: publishes link transforms from URDFs and joint states, and merges joint states.

It combines ROS's robot_state_publisher and joint_state_publisher. The simulation publishes the frames of its own models
itself, from the same URDFs and without another process; this service is for external robots, and for robots of a fleet
with ``enable_link_tf = false``, so that each frame has one publisher.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service

RATE_HZ = 50
"""Loop rate in Hz of simulation time, and the maximum rate of each transform."""


_FIXED = {"live": False}


class StateParameters(Parameters, frozen=True, kw_only=True):
    """Robots, and the sources of their URDFs and joint states; names as in ROS."""

    robots: Annotated[
        tuple[str, ...],
        Meta(description="Namespaces of the robots to serve; the node's own if empty.", extra=_FIXED),
    ] = ()
    model: Annotated[str, Meta(description="Name of a model in models/; empty to use urdf.", extra=_FIXED)] = ""
    urdf: Annotated[
        str, Meta(description="URDF file; empty to use the latched topic robot_description.", extra=_FIXED)
    ] = ""
    frame_prefix: Annotated[
        str | None,
        Meta(description="Prefix of all frames without a leading slash; the namespace by default.", extra=_FIXED),
    ] = None
    publish_frequency: Annotated[
        float,
        Meta(
            gt=0, le=RATE_HZ, description="Maximum rate of each joint's transform.", extra={"unit": "Hz", "live": False}
        ),
    ] = 50.0
    ignore_timestamp: Annotated[
        bool, Meta(description="Publish each transform, even sooner than publish_frequency allows.", extra=_FIXED)
    ] = False

    source_list: Annotated[
        tuple[str, ...],
        Meta(description="Topics with partial joint states to merge into joint_states.", extra=_FIXED),
    ] = ()
    publish_default_positions: Annotated[
        bool,
        Meta(
            description="Publish joints without a source at zero, or mid-range if the limits exclude zero.",
            extra=_FIXED,
        ),
    ] = False
    publish_default_velocities: Annotated[
        bool, Meta(description="Publish a velocity of 0 for joints without a source.", extra=_FIXED)
    ] = False
    publish_default_efforts: Annotated[
        bool, Meta(description="Publish an effort of 0 for joints without a source.", extra=_FIXED)
    ] = False
    zeros: Annotated[
        tuple[str, ...], Meta(description="Default positions other than zero, e.g. elbow=0.5.", extra=_FIXED)
    ] = ()
    dependent_joints: Annotated[
        tuple[str, ...],
        Meta(description="Joints that follow others, e.g. left=right or left=right*-1+0.1.", extra=_FIXED),
    ] = ()
    use_mimic_tags: Annotated[
        bool, Meta(description="Let joints follow others as the URDF's mimic tags say.", extra=_FIXED)
    ] = True
    use_smallest_joint_limits: Annotated[
        bool, Meta(description="Use the safety controller's soft limits where they are narrower.", extra=_FIXED)
    ] = True
    rate: Annotated[
        float,
        Meta(gt=0, le=RATE_HZ, description="Rate of the merged joint states.", extra={"unit": "Hz", "live": False}),
    ] = 10.0
    delta: Annotated[
        float,
        Meta(
            ge=0,
            le=10,
            description="Step by which joints without a source sweep back and forth, per message.",
            extra=_FIXED,
        ),
    ] = 0.0


SERVICE = Service(
    name="state",
    about="Publishes a robot's link transforms from its URDF and joint states, and merges joint states.",
    run="services.state.loop:run",
    rate=RATE_HZ,
    parameters=StateParameters,
)
