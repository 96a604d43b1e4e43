"""The kinematics of a differential drive: base speeds to wheel speeds and back, and the effect of wrong geometry."""

from __future__ import annotations

from dataclasses import dataclass

TOLERANCE = 0.02
"""Relative deviation of a configured value from the URDF's that gives no warning."""


@dataclass(frozen=True)
class WheelGeometry:
    """Wheel separation b and wheel radii, m."""

    separation: float
    left_radius: float
    right_radius: float

    def scaled(self, separation: float, left_radius: float, right_radius: float) -> WheelGeometry:
        """Return the geometry with each value multiplied, as found by a calibration."""
        return WheelGeometry(
            self.separation * separation, self.left_radius * left_radius, self.right_radius * right_radius
        )


def rim_speeds(geometry: WheelGeometry, v: float, w: float) -> tuple[float, float]:
    """Return the speeds of the rims, m/s: left = v - w b/2, right = v + w b/2."""
    half = w * geometry.separation / 2
    return v - half, v + half


def body_velocity(geometry: WheelGeometry, left: float, right: float) -> tuple[float, float]:
    """Return the forward speed [m/s] and turn rate [rad/s] that result from rim speeds."""
    return (left + right) / 2, (right - left) / geometry.separation


def describe_mismatch(configured: WheelGeometry, built: WheelGeometry) -> str:
    """Describe how a base that is ``built`` moves if its driver assumes ``configured``; empty within TOLERANCE.

    A wheel of radius r driven as if it had radius c covers r/c of the distance, so the base drives (r/c) v; with the
    track b assumed to be d it turns (d/b)(r/c) w. Its wheel odometry reports the command.
    """
    left, right = built.left_radius / configured.left_radius, built.right_radius / configured.right_radius
    track = configured.separation / built.separation
    if max(abs(1 / left - 1), abs(1 / right - 1), abs(track - 1)) <= TOLERANCE:
        return ""
    drives = (left + right) / 2
    turns = drives * track
    bend = ""
    if abs(left / right - 1) > TOLERANCE:
        bend = f"; a straight command bends, with the left rim at x{left:.2f} and the right one at x{right:.2f}"
    return (
        f"wheel radius {_radii(configured)} and separation {configured.separation:.4g} m are configured, the URDF has "
        f"{_radii(built)} and {built.separation:.4g} m: the base drives x{drives:.2f} the commanded speed and turns "
        f"x{turns:.2f} the commanded rate, while its wheel odometry reports x{1 / drives:.2f} the way and "
        f"x{1 / turns:.2f} the turn{bend}. Was a diameter entered as the radius, or the robot's width as the "
        "wheel separation?"
    )


def _radii(geometry: WheelGeometry) -> str:
    left, right = geometry.left_radius, geometry.right_radius
    return f"{left:.4g}" if left == right else f"{left:.4g} (left), {right:.4g} (right)"
