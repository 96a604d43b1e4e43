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
"""Age [ns] beyond which a joint state causes a warning."""
MAX_AHEAD_NS = 1_000_000_000
"""Maximum time [ns] for which a stamp in the future may suppress further transforms of a joint."""


class TransformResult(NamedTuple):
    """The transforms of a joint state, and a description of any problem with it."""

    transforms: tuple[TransformStamped, ...]
    warning: str = ""


class LinkTransforms:
    """Computes the link transforms of one robot. ``rejected`` counts joint states that were not used.

    A joint's transform is published at most once per ``period_ns`` [ns] of the joint states' stamps, which the
    transforms keep, unless ``ignore_timestamp``. A stamp in the far future suppresses a joint for at most
    MAX_AHEAD_NS. Mimic joints are published with their source.
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
        """The published frames: those of all links with a parent, except for floating and planar joints."""
        return frozenset(self.frame(j.child) for j in self.description.joints if j.single_dof or j.kind == "fixed")

    def reset(self) -> None:
        """Reset the rate limit, since time has gone back."""
        self._last.clear()

    def frame(self, link: str) -> str:
        """Return the frame of a link; a leading slash in its name avoids the prefix."""
        return link[1:] if link.startswith("/") else f"{self._prefix}{link}"

    def fixed_transforms(self, now: int) -> tuple[TransformStamped, ...]:
        """Return the transforms of all fixed joints."""
        return tuple(self._transform(each, 0.0, now) for each in self.description.joints if each.kind == "fixed")

    def moving_transforms(self, state: JointState, now: int) -> TransformResult:
        """Return the transforms of a joint state that are due; ``now`` [ns] is for its age."""
        if fault := _invalid_reason(state):
            self.rejected += 1
            return TransformResult((), f"a joint state is refused: {fault}")
        stamp = state.header.stamp.ns
        positions = self._with_mimics(dict(zip(state.name, state.position, strict=True)))
        due = [each for name, each in self._moving.items() if name in positions and self._is_due(name, stamp)]
        for each in due:
            self._last[each.name] = min(stamp, now + MAX_AHEAD_NS)
        warning = ""
        if stamp < now - MAX_AGE_NS:
            warning = f"the joint state is {(now - stamp) / 1e9:.1f} s old: does its sender follow simulation time?"
        return TransformResult(tuple(self._transform(each, positions[each.name], stamp) for each in due), warning)

    def _is_due(self, name: str, stamp: int) -> bool:
        last = self._last.get(name)
        return last is None or self._ignore or stamp >= last + self._period_ns

    def _with_mimics(self, positions: dict[str, float]) -> Mapping[str, float]:
        """Return the positions with those of mimic joints added; positions in the joint state take precedence."""
        for name in self._mimics:
            if (position := self._mimic_position(name, positions)) is not None:
                positions[name] = position
        return positions

    def _mimic_position(self, name: str, positions: Mapping[str, float]) -> float | None:
        """Return the position of a joint through its chain of mimic joints; None without a source."""
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
    """Return why a joint state cannot be used; a wrong number of positions is rejected when decoded."""
    if not state.position:
        return "it has no positions"
    if len(set(state.name)) < len(state.name):
        return "a name occurs twice"
    return ""
