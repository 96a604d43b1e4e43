"""A robot from anywhere as the simulation spawns it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from messages.se3 import Pose3
from models.robot_cache import is_made
from models.robot_facts import Skid, read_facts
from services.sim.drive.side_grip import SideGrip
from services.sim.physics.world import Body, BodyHandle


@dataclass(frozen=True)
class AdaptedBody:
    """A body to spawn, and how it skids, if it does."""

    body: Body
    skid: Skid | None = None

    def side_grip(self, handle: BodyHandle) -> SideGrip | None:
        """What keeps the spawned body from sliding sideways; None for one that does not skid."""
        return None if self.skid is None else SideGrip(handle, self.skid.middle, self.skid.friction)


def adapt_body(body: Body, model: str) -> AdaptedBody:
    """A robot from outside, lifted out of the ground if its root stands higher than its pose; joints whose limits leave
    out zero start at the limit. One of this project's own stays as it is."""
    if not is_made(model):
        return AdaptedBody(body)
    facts = read_facts(model)
    (x, y, z), turn = body.pose
    skid = facts.skid
    adapted = replace(
        body,
        pose=Pose3((x, y, max(z, facts.height)), turn),
        initial_positions=tuple({**facts.starts, **dict(body.initial_positions)}.items()),
        slides=() if skid is None else tuple(skid.axles.items()),
    )
    return AdaptedBody(adapted, skid)
