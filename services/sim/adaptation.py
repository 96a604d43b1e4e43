"""Adapts the body of an imported robot before it is spawned."""

from __future__ import annotations

from dataclasses import dataclass, replace

from messages.se3 import Pose3
from models.robot_cache import is_imported
from models.robot_facts import Skid, read_facts
from services.sim.drive.side_grip import SideGrip
from services.sim.physics.world import Body, BodyHandle


@dataclass(frozen=True)
class AdaptedBody:
    """A body to spawn, and its skid data if it is skid-steered."""

    body: Body
    skid: Skid | None = None

    def side_grip(self, handle: BodyHandle) -> SideGrip | None:
        """Return the sideways grip of the spawned body; None for one that does not skid."""
        return None if self.skid is None else SideGrip(handle, self.skid.middle, self.skid.friction)


def adapt_body(body: Body, model: str) -> AdaptedBody:
    """Raise an imported robot whose root is above its pose, and start joints whose range excludes 0 at a limit.

    The models of this project stay unchanged.
    """
    if not is_imported(model):
        return AdaptedBody(body)
    facts = read_facts(model)
    (x, y, z), orientation = body.pose
    skid = facts.skid
    adapted = replace(
        body,
        pose=Pose3((x, y, max(z, facts.height)), orientation),
        initial_positions=tuple({**facts.starts, **dict(body.initial_positions)}.items()),
        slides=() if skid is None else tuple(skid.axles.items()),
    )
    return AdaptedBody(adapted, skid)
