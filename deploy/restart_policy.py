"""Restart policy: what to do when a process ends, decided from its history alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

RestartMode = Literal["never", "on-failure", "always"]

BAD_INPUT = 2
"""Exit status after which a process is not restarted: its input is wrong and would be again."""

JITTER = 0.2
"""Maximum relative jitter of a pause, so that processes that failed together do not restart together."""


class RestartPolicy(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """When to restart a process, after which pause, and when to give up.

    The pause [s] starts at ``first`` and doubles with each restart within ``window`` [s], up to ``longest``; a process
    that ends again after ``limit`` restarts within ``window`` has failed. The figures are those of systemd (RestartSec
    100 ms) and dora (restart window); see OTP's "maximum restart intensity" for the idea.
    """

    when: RestartMode = "on-failure"
    first: Annotated[float, Meta(gt=0, le=60)] = 0.1
    longest: Annotated[float, Meta(gt=0, le=600)] = 5.0
    limit: Annotated[int, Meta(ge=0, le=1000)] = 5
    window: Annotated[float, Meta(gt=0, le=3600)] = 30.0


class Finished(msgspec.Struct, frozen=True):
    """The process has completed its work."""


class Restart(msgspec.Struct, frozen=True):
    """Restart the process after a pause [s]."""

    pause: float


class Failed(msgspec.Struct, frozen=True):
    """Give up on the process."""

    reason: str


ExitDecision = Finished | Restart | Failed


def decide_after_exit(
    policy: RestartPolicy, restarts: Sequence[float], now: float, status: int, chance: float, last_line: str = ""
) -> ExitDecision:
    """Return the action after an exit.

    ``restarts`` holds the times [s] of earlier restarts on the clock of ``now``; ``status`` is the exit status,
    negative for a signal, as in ``subprocess``; ``chance`` in [0, 1) determines the jitter; ``last_line`` is the last
    line of its log. Like systemd's RestartPreventExitStatus, BAD_INPUT prevents a restart whatever the policy.
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
    """Return e.g. ``exit status 1`` or ``killed by signal 9``."""
    return f"killed by signal {-status}" if status < 0 else f"exit status {status}"
