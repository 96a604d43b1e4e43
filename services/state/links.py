"""The transforms of a robot's links, with the rules of ROS's robot_state_publisher (noetic-devel)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from messages.base import LARGEST
from messages.geometry import TransformStamped
from messages.sensor import JointState
from messages.std import Header, Time
from models.urdf import Joint, RobotDescription

MAX_AGE_NS = 30_000_000_000
"""A joint state older than this is warned of."""
MAX_AHEAD_NS = 1_000_000_000
"""How far ahead of time a stamp may keep a joint from being told again."""


class TransformResult(NamedTuple):
    """What a joint state yields: transforms, and a sentence about what is odd with it."""

    transforms: tuple[TransformStamped, ...]
    warning: str = ""


class LinkTransforms:
    """One robot's links. ``refused`` counts joint states that were not used.

    A joint's transform is told at most once in ``period_ns`` [ns] by the stamps of the joint states, which become those
    of the transforms, unless ``ignore_timestamp``. One stamp from the far future silences a joint for AHEAD_NS at most.
    A joint that mimics another one is told with it.
    """

    def __init__(
        self, description: RobotDescription, prefix: str, period_ns: int, ignore_timestamp: bool = False
    ) -> None:
        self.description, self.rejected = description, 0
        self._prefix, self._period_ns, self._ignore = prefix, period_ns, ignore_timestamp
        self._moving = {each.name: each for each in description.joints if each.single_dof}
        self._mimics = {name: each.mimic for name, each in self._moving.items() if each.mimic is not None}
        self._last: dict[str, int] = {}

    @property
    def frames(self) -> frozenset[str]:
        """The frames that are told here: those of all links with a parent, but of floating and planar joints."""
        return frozenset(self.frame(j.child) for j in self.description.joints if j.single_dof or j.kind == "fixed")

    def reset(self) -> None:
        """Time has gone back: whatever comes next is told."""
        self._last.clear()

    def frame(self, link: str) -> str:
        """The frame of a link; a leading slash keeps the prefix away."""
        return link[1:] if link.startswith("/") else f"{self._prefix}{link}"

    def fixed_transforms(self, now: int) -> tuple[TransformStamped, ...]:
        """The transforms of all fixed joints."""
        return tuple(self._transform(each, 0.0, now) for each in self.description.joints if each.kind == "fixed")

    def moving_transforms(self, state: JointState, now: int) -> TransformResult:
        """The transforms that a joint state tells of, those of them that are due; ``now`` [ns] tells its age."""
        if fault := _invalid_reason(state):
            self.rejected += 1
            return TransformResult((), f"a joint state is refused: {fault}")
        stamp = state.header.stamp.ns
        positions = self._with_mimics(dict(zip(state.name, state.position, strict=True)))
        due = [each for name, each in self._moving.items() if name in positions and self._is_due(name, stamp)]
        for each in due:
            self._last[each.name] = min(stamp, now + MAX_AHEAD_NS)
        complaint = ""
        if stamp < now - MAX_AGE_NS:
            complaint = f"the joint state is {(now - stamp) / 1e9:.1f} s old: does its sender follow simulation time?"
        return TransformResult(tuple(self._transform(each, positions[each.name], stamp) for each in due), complaint)

    def _is_due(self, name: str, stamp: int) -> bool:
        last = self._last.get(name)
        return last is None or self._ignore or stamp >= last + self._period_ns

    def _with_mimics(self, positions: dict[str, float]) -> Mapping[str, float]:
        """The positions with those of the joints that mimic one of them; what a joint state says itself counts more."""
        for name in self._mimics:
            if (position := self._mimic_position(name, positions)) is not None:
                positions[name] = position
        return positions

    def _mimic_position(self, name: str, positions: Mapping[str, float]) -> float | None:
        """The position of a joint, through a chain of mimicry, which is known to end; None without its source."""
        chain = []
        while name not in positions:
            if (mimic := self._mimics.get(name)) is None:
                return None
            chain.append(mimic)
            name = mimic.joint
        position = positions[name]
        for mimic in reversed(chain):
            position = mimic.factor * position + mimic.offset
        return position if abs(position) <= LARGEST else None

    def _transform(self, joint: Joint, position: float, stamp: int) -> TransformStamped:
        return TransformStamped(
            header=Header(stamp=Time.of(stamp), frame_id=self.frame(joint.parent)),
            child_frame_id=self.frame(joint.child),
            transform=joint.transform(position).to_transform(),
        )


def _invalid_reason(state: JointState) -> str:
    """Why a joint state cannot be used; a wrong number of positions is refused as it is read."""
    if not state.position:
        return "it has no positions"
    if len(set(state.name)) < len(state.name):
        return "a name comes twice"
    return ""
