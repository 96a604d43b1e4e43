"""An effort as a request has it."""

from __future__ import annotations

from messages.gazebo import ApplyEffort
from messages.joints import JointEffort
from messages.std import Time


def effort(
    value: float, duration: float = 0.1, joint: str = "bear_link", model: str = "", start: int = 0
) -> ApplyEffort:
    """A job that is asked for."""
    job = JointEffort(joint_name=joint, effort=value, duration=duration, start_time=Time.of(start))
    return ApplyEffort(model=model, job=job)
