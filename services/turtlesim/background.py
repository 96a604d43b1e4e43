"""The background colour: parameters of the service, which ROS 1 programs also find in the parameter tree."""

from __future__ import annotations

from typing import Any

from messages.names import join
from messages.requests import ROSPARAM_GET, ROSPARAM_HAS, ROSPARAM_SET
from messages.rosparam import RosparamGet, RosparamKey, RosparamSet
from messages.topics import ROSPARAM_TREE
from messages.turtlesim import Color
from services.runtime.context import Context
from services.runtime.errors import BadInput, CallFailed
from services.runtime.parameters.tree import ParameterTree, parse_json, value_to_json
from services.turtlesim import TurtlesimParameters

CHANNELS = ("background_r", "background_g", "background_b")


class Background:
    """The colour: from the parameter tree if set there by others (``rosparam set``), else the service's parameters."""

    def __init__(self, ctx: Context[TurtlesimParameters]) -> None:
        self._ctx, self._tree = ctx, ctx.latest(ROSPARAM_TREE)
        self._published: dict[str, int] = {}
        self._initial: dict[str, int] = {}

    def publish(self) -> None:
        """Write the parameters to the tree, or read what a launch file has set there."""
        ctx = self._ctx
        for name in CHANNELS:
            key, value = join(ctx.node_name, name), getattr(ctx.params, name)
            try:
                if ctx.call(ROSPARAM_HAS, RosparamKey(key=key)).data:
                    found = ctx.call(ROSPARAM_GET, RosparamGet(key=key)).value
                    self._initial |= self._checked(name, parse_json(key, found))
                    continue
                ctx.call(ROSPARAM_SET, RosparamSet(key=key, value=value_to_json(value), writer=ctx.node_name))
            except CallFailed:
                return  # no parameter service: there is no tree
            self._published[name] = value

    @property
    def colour(self) -> Color:
        """The current colour."""
        values = {name: getattr(self._ctx.params, name) for name in CHANNELS} | self._initial
        if self._tree.value is not None:
            values |= self._stated(self._tree.value.tree)
        return Color(r=values["background_r"], g=values["background_g"], b=values["background_b"])

    def _stated(self, text: str) -> dict[str, int]:
        """Return the values in the tree that this service has not set itself."""
        try:
            tree = ParameterTree.from_json(text)
        except BadInput:
            return {}
        found: dict[str, int] = {}
        for name in CHANNELS:
            key = join(self._ctx.node_name, name)
            if not tree.has(key) or (value := tree.get(key)) == self._published.get(name):
                continue
            found |= self._checked(name, value)
        return found

    def _checked(self, name: str, value: Any) -> dict[str, int]:
        if isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value <= 255:
            return {name: int(value)}
        self._ctx.log.warn(f"{name} = {value!r} in the parameter tree is not a colour value from 0 to 255", every=5.0)
        return {}
