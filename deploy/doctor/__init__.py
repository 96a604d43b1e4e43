"""``elea doctor``: what could keep Elea from running here, each with why and what to do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

State = Literal["ok", "warn", "fail"]


class Finding(NamedTuple):
    """What a check has found: its name, how it stands, what it saw, and what to do about it."""

    name: str
    state: State
    why: str
    do: str = ""


Check = Callable[[], Iterator[Finding]]


def ok(name: str, why: str) -> Finding:
    """All is well."""
    return Finding(name, "ok", why)


def warn(name: str, why: str, do: str) -> Finding:
    """It runs, but not as well as it could."""
    return Finding(name, "warn", why, do)


def fail(name: str, why: str, do: str) -> Finding:
    """It does not run like this."""
    return Finding(name, "fail", why, do)
