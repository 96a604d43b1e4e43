"""The effort that a joint gets from the jobs that act on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

from models.limits import Limits


@dataclass(frozen=True)
class Rule:
    """How efforts become one, in our way or in Gazebo's.

    ``mode``: ``replace`` lets the job act that began last, ``sum`` adds up all that act, as Gazebo does.
    ``clamp``: ``total`` holds what acts to the URDF's effort limit, ``each`` every job by itself, as Gazebo does.
    ``velocity``: beyond the URDF's velocity limit, no effort acts along the motion. A limit of 0 is ``unspecified``, or
    it is a limit, as in Gazebo (``gazebo``): then effort acts on a joint at rest, or against its motion.
    """

    mode: Literal["replace", "sum"] = "replace"
    clamp: Literal["total", "each"] = "total"
    velocity: Literal["unspecified", "gazebo"] = "unspecified"


def total(rule: Rule, limits: Limits, rate: float, efforts: Sequence[float]) -> float:
    """The effort [N m or N] on a joint that moves at ``rate`` [rad/s or m/s], from the efforts of the acting jobs.

    An effort limit of 0 leaves no effort at all, as in Gazebo.
    """
    if rule.clamp == "each":
        return sum(_held(rule, limits, rate, effort) for effort in efforts)
    return _held(rule, limits, rate, sum(efforts))


def _held(rule: Rule, limits: Limits, rate: float, effort: float) -> float:
    fastest = limits.velocity
    if fastest is None or (fastest == 0 and rule.velocity == "unspecified"):
        fastest = inf
    if (rate > fastest and effort > 0) or (rate < -fastest and effort < 0):
        return 0.0
    most = inf if limits.effort is None else limits.effort
    return max(-most, min(most, effort))
