"""The parameters of a model without wheels: what efforts on its joints come to, and what the joints resist."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.runtime.service import Parameters


class JointParameters(Parameters, frozen=True, kw_only=True):
    """How the joints of one model behave. None: as the model's URDF says.

    The set of a robot ``a`` is ``/a/joints``. All are live but who tells its links.
    """

    effort_mode: Annotated[
        Literal["replace", "sum"],
        Meta(description="the job that began last acts, or, as in Gazebo, all that overlap add up"),
    ] = "replace"
    effort_clamp: Annotated[
        Literal["total", "each"],
        Meta(description="the URDF's effort limit holds for what acts, or, as in Gazebo, for each job by itself"),
    ] = "total"
    velocity_rule: Annotated[
        Literal["unspecified", "gazebo"],
        Meta(description="a URDF velocity of 0 is none, or, as in Gazebo, a limit: no effort along the motion"),
    ] = "unspecified"
    damping: (
        Annotated[
            float, Meta(ge=0, le=1e6, description="of every joint; the URDF's", extra={"unit": "N m s/rad or N s/m"})
        ]
        | None
    ) = None
    friction: (
        Annotated[float, Meta(ge=0, le=1e6, description="dry, of every joint; the URDF's", extra={"unit": "N m or N"})]
        | None
    ) = None
    noise: Annotated[bool, Meta(description="sensors have the noise of the real ones")] = True
    enable_link_tf: Annotated[
        bool,
        Meta(description="links on /tf and /tf_static; false leaves them to the service state", extra={"live": False}),
    ] = True
