"""Who may touch whom in PyBullet, and the friction of what touches.

Rolling parts touch the ground alone, because a sphere is wider than the wheel it stands for. Masks are spelt out: with
the mask -1 PyBullet lets rolling parts and bodies collide all the same.
"""

from __future__ import annotations

from services.sim.physics._pybullet import pybullet

_BODY_BIT, _ROLLER_BIT, _GROUND_BIT, _FIXED_BIT = 1, 2, 4, 8

Filter = tuple[int, int]
"""A collision group and the mask of those that it touches."""

BODY: Filter = (_BODY_BIT, _BODY_BIT | _GROUND_BIT | _FIXED_BIT)
FIXED: Filter = (_FIXED_BIT, _BODY_BIT)
"""Of bodies that never move: they are not looked at against each other, which costs 8 ms a step for 2,400 boxes."""
ROLLER: Filter = (_ROLLER_BIT, _GROUND_BIT)
GROUND: Filter = (_GROUND_BIT, _BODY_BIT | _ROLLER_BIT)
MOVING_GROUND: Filter = (_BODY_BIT | _GROUND_BIT, _BODY_BIT | _ROLLER_BIT)


def set_contact_dynamics(client: int, number: int, link: int, friction: float, touches: Filter) -> None:
    """Give a link its friction and its collision filter, and take the engine's damping from its body."""
    # Two calls: in one, PyBullet leaves the friction at 0.5, and a burger spins 3.9 % short.
    pybullet.changeDynamics(number, link, lateralFriction=friction, physicsClientId=client)
    pybullet.changeDynamics(number, link, linearDamping=0, angularDamping=0, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(number, link, *touches, physicsClientId=client)
