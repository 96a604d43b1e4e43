"""``elea doctor``: problems that may keep Elea from running, each with its cause and remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

State = Literal["ok", "warn", "fail"]


class Finding(NamedTuple):
    """The finding of a check: its name, state, reason and remedy."""

    name: str
    state: State
    why: str
    do: str = ""


Check = Callable[[], Iterator[Finding]]


def ok(name: str, why: str) -> Finding:
    """Return a finding without a problem."""
    return Finding(name, "ok", why)


def warn(name: str, why: str, do: str) -> Finding:
    """Return a finding of a problem that degrades the system."""
    return Finding(name, "warn", why, do)


def fail(name: str, why: str, do: str) -> Finding:
    """Return a finding of a problem that prevents the system from running."""
    return Finding(name, "fail", why, do)
