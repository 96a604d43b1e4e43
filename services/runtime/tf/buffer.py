"""The transform buffer: the recent history of the frame tree, with the semantics of ROS's tf2.

A leading slash of a frame name is removed, as in tf.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import NamedTuple

from messages.geometry import TransformStamped
from messages.se3 import IDENTITY, Pose3
from messages.std import Header
from services.runtime.errors import FrameLoop, NotConnected, NoTransform, UnknownFrame, did_you_mean, list_names
from services.runtime.tf.authority import FrameAuthorities
from services.runtime.tf.time_cache import StampedTransform, TimeCache

WORLD = "world"
"""The frame of the world."""
CACHE_S = 10.0
"""Length of the cache [s of simulation time]; tf2's default."""
MAX_FRAMES = 4096
"""Maximum frames; further ones are refused."""
MAX_PUBLISHERS = 256
"""Maximum publishers of static frames; transforms of further ones are refused."""
NOT_UNIT = 0.01
"""Tolerance of a quaternion's squared norm; tf2's."""
_LISTED = 30


class LookupResult(NamedTuple):
    """The pose of a frame in another, and its time [ns]; None if it is static."""

    time: int | None
    transform: Pose3


class TransformBuffer:
    """Stores transforms for ``lookup``. Old, repeated and refused ones are counted and have no other effect.

    For a frame published as both moving and static, or as static by several publishers, the last transform counts, as
    in tf2.
    """

    def __init__(self, cache_s: float = CACHE_S) -> None:
        self.old = self.repeated = self.refused = 0
        self.reason = ""
        self._cache_ns = round(cache_s * 1e9)
        self._moving: dict[str, TimeCache] = {}
        self._static: dict[str, StampedTransform] = {}
        self._static_of: dict[bytes, dict[str, StampedTransform]] = {}
        self._claims = FrameAuthorities(self._cache_ns)
        self._parents: set[str] = set()
        self._most_parents = MAX_FRAMES

    def add(self, transforms: Iterable[TransformStamped], publisher: bytes) -> None:
        """Add moving transforms."""
        for each in transforms:
            if (child := self._child(each)) is None:
                continue
            history = self._moving.get(child)
            if history is None:
                if not self._has_room():
                    continue
                history = self._moving[child] = TimeCache(child, self._cache_ns)
            stamp, parent = each.header.stamp.ns, each.header.frame_id.removeprefix("/")
            verdict = history.add(stamp, StampedTransform(parent, Pose3.from_msg(each.transform)))
            if verdict == "old":
                self.old += 1
                continue
            # Two publishers of a frame often send the same stamps: the second one's count as repeated.
            self._claims.moving(child, publisher, parent, stamp)
            if verdict == "repeated":
                self.repeated += 1
            else:
                self._add_parent(parent)

    def add_static(self, transforms: Iterable[TransformStamped], publisher: bytes) -> None:
        """Replace a publisher's static transforms by these.

        So a late subscriber, which gets each publisher's last message, has the same tree as an early one. Foreign
        senders (empty ``publisher``) cannot be distinguished: their transforms add up. A moving frame becomes static.
        """
        if publisher not in self._static_of and len(self._static_of) >= MAX_PUBLISHERS:
            self.refused, self.reason = self.refused + 1, f"more than {MAX_PUBLISHERS} publishers of static frames"
            return
        links = dict(self._static_of.get(publisher, {})) if not publisher else {}
        for each in transforms:
            child = self._child(each)
            if child is not None and (child in links or len(links) < MAX_FRAMES):
                links[child] = StampedTransform(each.header.frame_id.removeprefix("/"), Pose3.from_msg(each.transform))
                self._moving.pop(child, None)
        self._static_of.pop(publisher, None)  # moves it to the end of the table: the last one received wins
        self._static_of[publisher] = links
        self._claims.static(publisher, {child: link.parent for child, link in links.items()})
        self._static = {child: link for links in self._static_of.values() for child, link in links.items()}
        self._parents |= {link.parent for link in links.values()}

    def clear(self) -> None:
        """Drop the moving transforms after a reset. Static ones stay, as in tf2."""
        self._moving.clear()
        self._claims.clear()
        self._parents = {link.parent for link in self._static.values()}

    def frames(self) -> list[str]:
        """Return the names of all frames."""
        return sorted(self._parents | self._moving.keys() | self._static.keys())

    def parent(self, frame: str, time: int | None = None) -> str | None:
        """Return the parent of ``frame`` at a time [ns], by default the latest; None for the root of a tree."""
        if (history := self._moving.get(frame)) is not None:
            return history.parent(time)
        link = self._static.get(frame)
        return link.parent if link is not None else None

    def span(self, frame: str) -> tuple[int, int] | None:
        """Return the oldest and newest stamp [ns] of a moving frame; None for a static frame or a root."""
        history = self._moving.get(frame)
        return (history.oldest, history.newest) if history is not None else None

    def samples(self, frame: str) -> int:
        """Return the number of transforms kept for a frame: 1 for a static frame, 0 for a root."""
        if (history := self._moving.get(frame)) is not None:
            return len(history)
        return int(frame in self._static)

    def conflicts(self) -> dict[str, str]:
        """Return the frames with several publishers, each with a sentence for the log."""
        return self._claims.conflicts()

    def publishers(self, frame: str) -> list[bytes]:
        """Return the publishers of a frame."""
        return self._claims.publishers(frame)

    def lookup(self, target: str, source: str, time: int | None = None) -> LookupResult:
        """Return the transform that maps points from ``source`` to ``target``, like tf2's ``lookupTransform``.

        Args:
            target: The frame to map to.
            source: The frame to map from. A frame to itself gives the identity, even if it is unknown.
            time: Simulation time [ns]; None for the latest common time.

        Raises:
            NoTransform: UnknownFrame, NotConnected, Extrapolation or FrameLoop.
        """
        target, source = target.removeprefix("/"), source.removeprefix("/")
        if target == source and target:
            return LookupResult(self._newest([target]) if time is None else time, IDENTITY)
        target, source = self._known(target), self._known(source)
        if time is None:
            above, below = self._paths(target, source, None)
            time = self._newest([*above, *below])
        above, below = self._paths(target, source, time)
        rigid = self._up(above, time).inverse().compose(self._up(below, time))
        return LookupResult(time, rigid)

    def lookup_full(
        self, target: str, target_time: int | None, source: str, source_time: int | None, fixed: str
    ) -> LookupResult:
        """Return the transform from ``source`` at ``source_time`` [ns] to ``target`` at ``target_time`` [ns].

        ``fixed`` is a frame that does not move in between, as in tf2's ``lookupTransform`` with five arguments:
        T = T(target <- fixed, target_time) T(fixed <- source, source_time). The result has the target's time. A time
        of None is the latest one common with ``fixed``. Raises NoTransform.
        """
        for each in (target, source, fixed):
            self._known(each)
        then, now = self.lookup(fixed, source, source_time), self.lookup(target, fixed, target_time)
        return LookupResult(now.time, now.transform.compose(then.transform))

    def _child(self, transform: TransformStamped) -> str | None:
        """Return the child's name of a valid transform; count an invalid one as refused and return None."""
        child, parent = transform.child_frame_id.removeprefix("/"), transform.header.frame_id.removeprefix("/")
        q, t = transform.transform.rotation, transform.transform.translation
        square = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
        if not child or not parent:
            reason = f"a transform from {parent!r} to {child!r}: a frame without a name"
        elif child == parent:
            reason = f"frame {child!r} is its own parent"
        elif not (isfinite(t.x) and isfinite(t.y) and isfinite(t.z)):
            reason = f"frame {child!r}: its translation is not finite: {t.x:g}, {t.y:g}, {t.z:g}"
        elif not abs(square - 1) <= NOT_UNIT:  # nor is NaN
            reason = f"frame {child!r}: its rotation is not a unit quaternion, its squared length is {square:g}"
        else:
            return child
        self.refused, self.reason = self.refused + 1, reason[:200]
        return None

    def _has_room(self) -> bool:
        """Return whether another frame fits; drops frames without recent transforms if necessary."""
        if len(self._moving) >= MAX_FRAMES:
            newest = max(each.newest for each in self._moving.values())
            self._moving = {name: each for name, each in self._moving.items() if each.newest >= newest - self._cache_ns}
            self._claims.prune()
        if len(self._moving) < MAX_FRAMES:
            return True
        self.refused, self.reason = self.refused + 1, f"more than {MAX_FRAMES} frames"
        return False

    def _add_parent(self, parent: str) -> None:
        """Record a parent frame; drops parents that no transform refers to any longer, to bound memory."""
        self._parents.add(parent)
        if len(self._parents) > self._most_parents:
            self._parents = {link.parent for link in self._static.values()}
            self._parents |= {each.parent(None) for each in self._moving.values()}
            self._most_parents = 2 * len(self._parents) + MAX_FRAMES

    def _newest(self, frames: Iterable[str]) -> int | None:
        """Return the latest common time [ns] of the moving frames among these; None if none of them moves."""
        return min((self._moving[each].newest for each in frames if each in self._moving), default=None)

    def _known(self, frame: str) -> str:
        name = frame.removeprefix("/")
        if name in self._moving or name in self._static or name in self._parents:
            return name
        known = self.frames()
        if not known:
            raise UnknownFrame(
                f"frame {name!r} is unknown: no transform was received on /tf or /tf_static; are they published?"
            )
        listed = list_names(known, _LISTED)
        raise UnknownFrame(f"frame {name!r} is unknown{did_you_mean(name, known, 3)} (known: {listed})")

    def _paths(self, target: str, source: str, time: int | None) -> tuple[list[str], list[str]]:
        """Return the frames from each up to but excluding their common ancestor; raises NotConnected or FrameLoop."""
        above, below = self._ancestry(target, time), self._ancestry(source, time)
        place = {frame: index for index, frame in enumerate(above)}
        for index, frame in enumerate(below):
            if frame in place:
                return above[: place[frame]], below[:index]
        raise NotConnected(
            f"no transforms connect {target!r} and {source!r}, they are in two trees: "
            f"{self._tree(above[-1])}; and {self._tree(below[-1])}: which node should publish a transform between them?"
        )

    def _ancestry(self, frame: str, time: int | None) -> list[str]:
        """Return the frame and its ancestors up to the root; raises FrameLoop."""
        line, seen = [frame], {frame}
        while (parent := self.parent(line[-1], time)) is not None:
            if parent in seen:
                raise FrameLoop(
                    f"frames in a loop: {' in '.join([*line[line.index(parent) :], parent])}; one of these transforms "
                    "has its parent and child swapped"
                )
            line.append(parent)
            seen.add(parent)
        return line

    def _tree(self, root: str) -> str:
        below = [each for each in self.frames() if each != root and self._root(each) == root]
        return f"{root!r} with {list_names(below, _LISTED)}" if below else f"{root!r} alone"

    def _root(self, frame: str) -> str:
        seen = {frame}
        while (parent := self.parent(frame)) is not None and parent not in seen:
            frame = parent
            seen.add(frame)
        return frame

    def _up(self, path: list[str], time: int | None) -> Pose3:
        """Return the transform from a path's first frame to the parent of its last one."""
        here = IDENTITY
        for frame in path:
            history = self._moving.get(frame)
            if history is None:
                link = self._static[frame]
            else:
                assert time is not None
                link = history.at(time)
            here = link.transform @ here
        return here


def pose_in_world(buffer: TransformBuffer, header: Header) -> Pose3:
    """Return the pose of a message's frame in the world, at its stamp or else the latest known one; the identity if no
    transform connects the two."""
    if header.frame_id.lstrip("/") in ("", WORLD):
        return IDENTITY
    for time in (header.stamp.ns or None, None):
        try:
            return buffer.lookup(WORLD, header.frame_id, time).transform
        except NoTransform:
            continue
    return IDENTITY
