"""Collision filters and contact friction in PyBullet.

Rolling parts touch only the ground, because a sphere is wider than the wheel it stands for. Masks are written out: with
the mask -1, PyBullet lets rolling parts and bodies collide after all.
"""

from __future__ import annotations

from services.sim.physics._pybullet import pybullet

_BODY_BIT, _ROLLER_BIT, _GROUND_BIT, _FIXED_BIT = 1, 2, 4, 8

Filter = tuple[int, int]
"""A collision group, and the mask of the groups that it collides with."""

BODY: Filter = (_BODY_BIT, _BODY_BIT | _GROUND_BIT | _FIXED_BIT)
FIXED: Filter = (_FIXED_BIT, _BODY_BIT)
"""For bodies that never move: they are not checked against each other, which would cost 8 ms a step for 2,400 boxes."""
ROLLER: Filter = (_ROLLER_BIT, _GROUND_BIT)
GROUND: Filter = (_GROUND_BIT, _BODY_BIT | _ROLLER_BIT)
MOVING_GROUND: Filter = (_BODY_BIT | _GROUND_BIT, _BODY_BIT | _ROLLER_BIT)


def set_contact_dynamics(client: int, number: int, link: int, friction: float, touches: Filter) -> None:
    """Set a link's friction and collision filter, and turn off the engine's damping of its body."""
    # Two calls: in one, PyBullet leaves the friction at 0.5, and a burger spins 3.9 % short.
    pybullet.changeDynamics(number, link, lateralFriction=friction, physicsClientId=client)
    pybullet.changeDynamics(number, link, linearDamping=0, angularDamping=0, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(number, link, *touches, physicsClientId=client)
