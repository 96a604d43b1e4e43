"""What a robot from outside needs in the world beside its URDF."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    """The body of a robot from outside; the driven wheels of one that skids slide along their axles."""
    skid = read_facts(model).skid if is_made(model) else None
    if skid is None:
        return AdaptedBody(body)
    return AdaptedBody(replace(body, slides=tuple(skid.axles.items())), skid)
