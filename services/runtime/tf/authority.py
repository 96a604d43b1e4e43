"""Tracks the publishers of each frame, and reports frames with several parents or publishers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

MAX_AUTHORITIES = 64
"""Maximum publishers of one frame that are remembered; a further one replaces the oldest."""


class Authority(NamedTuple):
    """A publisher's parent for a frame, and the stamp [ns] of its last transform; None for a static one."""

    parent: str
    stamp: int | None


class FrameAuthorities:
    """The publishers of each frame; one without a new transform for ``cache_ns`` [ns] is ignored."""

    def __init__(self, cache_ns: int) -> None:
        self._cache_ns = cache_ns
        self._of: dict[str, dict[bytes, Authority]] = {}
        self._conflicting: set[str] = set()
        self._newest = 0

    def moving(self, child: str, publisher: bytes, parent: str, stamp: int) -> None:
        """Record a transform of a moving frame."""
        self._add(child, publisher, Authority(parent, stamp))
        self._newest = max(self._newest, stamp)

    def static(self, publisher: bytes, parents: Mapping[str, str]) -> None:
        """Record a publisher's static frames, which replace its earlier ones."""
        for child, claims in self._of.items():
            old = claims.get(publisher)
            if old is not None and old.stamp is None and child not in parents:
                del claims[publisher]
        for child, parent in parents.items():
            self._add(child, publisher, Authority(parent, None))

    def clear(self) -> None:
        """Forget the moving frames."""
        self._keep(lambda claim: claim.stamp is None)
        self._newest = 0

    def prune(self) -> None:
        """Forget publishers without a new transform for ``cache_ns``."""
        since = self._newest - self._cache_ns
        self._keep(lambda claim: claim.stamp is None or claim.stamp >= since)

    def publishers(self, frame: str) -> list[bytes]:
        """Return the current publishers of a frame."""
        return sorted(self._valid(frame))

    def conflicts(self) -> dict[str, str]:
        """Return a sentence for each frame with several publishers."""
        found = {}
        for child in sorted(self._conflicting):
            claims = self._valid(child)
            if len(claims) < 2:
                continue
            parents = sorted({claim.parent for claim in claims.values()})
            if len(parents) > 1:
                found[child] = f"frame {child!r} has {len(parents)} parents, {' and '.join(map(repr, parents))}"
            else:
                found[child] = f"frame {child!r} has {len(claims)} publishers"
            if len({claim.stamp is None for claim in claims.values()}) > 1:
                found[child] += ", and is published as both static and moving"
        return found

    def _add(self, child: str, publisher: bytes, claim: Authority) -> None:
        claims = self._of.setdefault(child, {})
        if publisher not in claims and len(claims) >= MAX_AUTHORITIES:
            del claims[next(iter(claims))]
        claims[publisher] = claim
        if len(claims) > 1:
            self._conflicting.add(child)

    def _valid(self, frame: str) -> dict[bytes, Authority]:
        since = self._newest - self._cache_ns
        claims = self._of.get(frame, {})
        return {publisher: claim for publisher, claim in claims.items() if claim.stamp is None or claim.stamp >= since}

    def _keep(self, condition: Callable[[Authority], bool]) -> None:
        kept = {
            child: {publisher: claim for publisher, claim in claims.items() if condition(claim)}
            for child, claims in self._of.items()
        }
        self._of = {child: claims for child, claims in kept.items() if claims}
        self._conflicting = {child for child, claims in self._of.items() if len(claims) > 1}
