"""The static transform service: publishes one static transform, like tf2's static_transform_publisher."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from messages.base import Metres, Radians
from services.runtime import Parameters, Service, param

Part = Annotated[float, Meta(ge=-1.0, le=1.0)]


class StaticTransformParameters(Parameters):
    """The pose of ``child_frame_id`` in ``frame_id``: a translation, and a rotation by angles or as a quaternion."""

    x: Metres = param(0.0, text="Translation along x [m].", live=False)
    y: Metres = param(0.0, text="Translation along y [m].", live=False)
    z: Metres = param(0.0, text="Translation along z [m].", live=False)
    yaw: Radians = param(0.0, text="Rotation about z [rad].", live=False)
    pitch: Radians = param(0.0, text="Rotation about y [rad].", live=False)
    roll: Radians = param(0.0, text="Rotation about x [rad].", live=False)
    quaternion: Annotated[tuple[Part, ...], Meta(max_length=4)] = param(
        (), text="Rotation as x, y, z, w, in place of the angles.", live=False
    )
    frame_id: str = param("", text="The parent frame.", max_length=255, live=False)
    child_frame_id: str = param("", text="The child frame.", max_length=255, live=False)


SERVICE = Service(
    name="static_transform",
    about="Publishes one fixed transform between two frames.",
    run="services.static_transform.loop:run",
    rate=1,
    parameters=StaticTransformParameters,
    parameter_set=None,
)
