"""The motion of a holonomic base, whose commanded velocity is set directly."""

from __future__ import annotations

from messages.se3 import rotate
from services.sim.physics.world import BodyHandle


def set_planar_velocity(body: BodyHandle, ahead: float, sideways: float, turn: float) -> None:
    """Set the velocity of a body in its own axes, m/s and rad/s; falling and tilting are left to physics."""
    state = body.state()
    x, y, _ = rotate(state.orientation, (ahead, sideways, 0.0))
    body.set_velocity((x, y, state.linear[2]), (state.angular[0], state.angular[1], turn))
