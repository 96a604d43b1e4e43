"""Restart policy: what follows the end of a process, decided from its past alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

RestartMode = Literal["never", "on-failure", "always"]

BAD_INPUT = 2
"""Exit status after which a process is not restarted: its input is wrong, and would be again."""

JITTER = 0.2
"""Largest part by which a pause is lengthened or shortened, so that what fell together does not rise together."""


class RestartPolicy(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """When a process is started again, after which pause, and when to give up.

    The pause [s] begins at ``first`` and doubles with each restart within ``window`` up to ``longest``; a process that
    has been restarted ``limit`` times within ``window`` [s] and ends again has failed. The figures are those of
    systemd (RestartSec 100 ms) and dora (restart window), see OTP's "maximum restart intensity" for the idea.
    """

    when: RestartMode = "on-failure"
    first: Annotated[float, Meta(gt=0, le=60)] = 0.1
    longest: Annotated[float, Meta(gt=0, le=600)] = 5.0
    limit: Annotated[int, Meta(ge=0, le=1000)] = 5
    window: Annotated[float, Meta(gt=0, le=3600)] = 30.0


class Finished(msgspec.Struct, frozen=True):
    """It has done its work."""


class Restart(msgspec.Struct, frozen=True):
    """Start it again after a pause [s]."""

    pause: float


class Failed(msgspec.Struct, frozen=True):
    """It is given up."""

    reason: str


ExitDecision = Finished | Restart | Failed


def decide_after_exit(
    policy: RestartPolicy, restarts: Sequence[float], now: float, status: int, chance: float, last_line: str = ""
) -> ExitDecision:
    """The action after an exit.

    ``restarts`` holds the times [s] of earlier restarts on the clock of ``now``; ``status`` is the exit status,
    negative for a signal, as in ``subprocess``; ``chance`` in [0, 1) draws the jitter; ``last_line`` is its last line.
    As systemd's RestartPreventExitStatus, BAD_INPUT counts whatever the policy says.
    """
    if status == 0 and policy.when != "always":
        return Finished()
    how = describe_exit(status)
    why = f": {last_line}" if last_line and status > 0 else ""
    if status == BAD_INPUT or policy.when == "never":
        return Failed(f"{how}{why}")
    recent = sum(1 for each in restarts if now - each < policy.window)
    if recent >= policy.limit:
        return Failed(f"{how}; restarted {recent} times within {policy.window:g} s{why}")
    pause = min(policy.longest, policy.first * 2.0**recent)
    return Restart(min(policy.longest, pause * (1.0 + JITTER * (2.0 * chance - 1.0))))


def describe_exit(status: int) -> str:
    """``exit status 1``, or ``killed by signal 9``."""
    return f"killed by signal {-status}" if status < 0 else f"exit status {status}"
