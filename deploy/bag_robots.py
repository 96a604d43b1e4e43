"""The robots in a bag: found by their descriptions, with the ground that they covered."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.base import WrongPayload
from messages.nav import Odometry
from messages.std import String
from messages.topics import GROUND_TRUTH, ROBOT_DESCRIPTION
from models import MODELS, model_path
from models.figures import read_model
from services.bag.reading import Bag
from services.bag.typed import Typed, beside, why_not

_MARGIN = 0.5
"""Metres around the robots' ways that the first picture shows."""


class Robots(NamedTuple):
    """Namespace and model of each robot, and the ground (x, y of a corner, then of the opposite one) [m]."""

    robots: list[tuple[str, str]]
    extent: tuple[float, float, float, float]


def robots_in(bag: Bag) -> Robots:
    """The robots of this project's models; those of others are left out."""
    models = {model_path(name).read_text(): name for name in MODELS}
    robots: dict[str, str] = {}
    low, high = [math.inf, math.inf], [-math.inf, -math.inf]
    typed = Typed()
    for entry in bag.entries():
        namespace, _, name = entry.channel.name.rpartition("/")
        wanted = name in (GROUND_TRUTH.name, ROBOT_DESCRIPTION.name) or beside(entry.channel)
        if not wanted or why_not(entry.channel):
            continue
        try:
            message = typed.message(entry)
        except WrongPayload:
            continue
        if isinstance(message, String) and (model := models.get(message.data)) is not None:
            robots[namespace] = model
        elif isinstance(message, Odometry):
            at = message.pose.pose.position
            low, high = [min(low[0], at.x), min(low[1], at.y)], [max(high[0], at.x), max(high[1], at.y)]
    if not math.isfinite(low[0]):
        low, high = [-1.0, -1.0], [1.0, 1.0]
    extent = (low[0] - _MARGIN, low[1] - _MARGIN, high[0] + _MARGIN, high[1] + _MARGIN)
    return Robots(sorted(robots.items(), key=_rank), extent)


def _rank(robot: tuple[str, str]) -> tuple[bool, str]:
    """Arms come last: they leave no trail, and need no colour that is told from afar."""
    namespace, model = robot
    return read_model(model).wheels is None, namespace
