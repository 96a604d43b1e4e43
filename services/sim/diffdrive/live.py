"""What may change while a base drives: one record, replaced as a whole between two steps."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Live:
    """The live parameters of ROS's ``diff_drive_controller``.

    Multipliers of what is configured; ``publish_rate`` [Hz] of odometry, 0 for none; ``enable_odom_tf`` tells whether
    odometry is a transform on ``/tf``, too.
    """

    wheel_separation_multiplier: float = 1.0
    left_wheel_radius_multiplier: float = 1.0
    right_wheel_radius_multiplier: float = 1.0
    publish_rate: float = 50.0
    enable_odom_tf: bool = True
