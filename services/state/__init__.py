"""The state service: publishes link transforms from URDFs and joint states, and merges joint states.

It combines ROS's robot_state_publisher and joint_state_publisher. The simulation publishes the frames of its own models
itself, from the same URDFs and without another process; this service is for external robots, and for robots of a fleet
with ``enable_link_tf = false``, so that each frame has one publisher.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime import Parameters, Service, param

RATE_HZ = 50
"""Loop rate in Hz of simulation time, and the maximum rate of each transform."""


class StateParameters(Parameters):
    """Robots, and the sources of their URDFs and joint states; names as in ROS."""

    robots: tuple[str, ...] = param((), text="Namespaces of the robots to serve; the node's own if empty.", live=False)
    model: str = param("", text="Name of a model in models/, or path of a robot; empty to use urdf.", live=False)
    urdf: str = param("", text="URDF file; empty to use the latched topic robot_description.", live=False)
    frame_prefix: str | None = param(
        None, text="Prefix of frames, except links named with a leading slash; the namespace by default.", live=False
    )
    publish_frequency: Annotated[
        float,
        Meta(
            gt=0, le=RATE_HZ, description="Maximum rate of each joint's transform.", extra={"unit": "Hz", "live": False}
        ),
    ] = 50.0
    ignore_timestamp: bool = param(
        False, text="Publish each transform, even sooner than publish_frequency allows.", live=False
    )

    publish_transforms: bool = param(
        True, text="Publish the transforms of links; otherwise only merged joint states.", live=False
    )
    source_list: tuple[str, ...] = param(
        (), text="Topics with partial joint states to merge into joint_states.", live=False
    )
    publish_default_positions: bool = param(
        False, text="Publish joints without a source at zero, or mid-range if the limits exclude zero.", live=False
    )
    publish_default_velocities: bool = param(
        False, text="Publish a velocity of 0 for joints without a source.", live=False
    )
    publish_default_efforts: bool = param(False, text="Publish an effort of 0 for joints without a source.", live=False)
    zeros: tuple[str, ...] = param((), text="Default positions other than zero, e.g. elbow=0.5.", live=False)
    dependent_joints: tuple[str, ...] = param(
        (), text="Joints that follow others, e.g. left=right or left=right*-1+0.1.", live=False
    )
    use_mimic_tags: bool = param(True, text="Let joints follow others as the URDF's mimic tags say.", live=False)
    use_smallest_joint_limits: bool = param(
        True, text="Use the safety controller's soft limits where they are narrower.", live=False
    )
    rate: Annotated[
        float,
        Meta(gt=0, le=RATE_HZ, description="Rate of the merged joint states.", extra={"unit": "Hz", "live": False}),
    ] = 10.0
    delta: float = param(
        0.0, 0, 10, "", "Step by which joints without a source sweep back and forth, per message.", live=False
    )


SERVICE = Service(
    name="state",
    about="Publishes a robot's link transforms from its URDF and joint states, and merges joint states.",
    run="services.state.loop:run",
    rate=RATE_HZ,
    parameters=StateParameters,
)
