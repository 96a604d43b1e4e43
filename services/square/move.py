"""What a law makes of one tick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from services.motion.planar import Motion, Planar

State = Literal["waiting", "driving", "reached", "finished"]


@dataclass(frozen=True, slots=True)
class Move:
    """The command, None where the law has none to send; the corner pursued; and the pose that it should have now.

    ``doing`` is the law's own word for it, as the log shows it. ``late`` tells that the robot leaves the corner without
    having met it within the tolerances.
    """

    state: State
    command: Motion | None
    index: int
    desired: Planar
    doing: str
    late: bool = False
