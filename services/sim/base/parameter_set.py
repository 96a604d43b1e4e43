"""The set of parameters of one robot's base, ``NAMESPACE/base``: the one owner of their values, and how they change."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import msgspec

from messages.parameters import ParameterDescription
from messages.simulation import DriveSettings
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.record import describe
from services.sim import BaseParameters, RobotEntry
from services.sim.base.settings import Configured, Settings, base_settings, completed, configured, effective
from services.sim.robot_set import RobotSet


class BaseSet:
    """``settings`` follow from the parameters as they stand; whoever drives by them takes them anew after a change."""

    def __init__(self, node: Node, namespace: str, entry: RobotEntry, wait: bool) -> None:
        own = _own(entry)
        assert own.settings is not None
        self.name, self._model, self._kind = entry.name, own.model, entry.model
        self._torque_driven = own.settings.gains is not None
        figures = effective(entry.model, own.model, BaseParameters())
        described = [self._as_built(each, own.parameters) for each in describe(BaseParameters, figures)]
        self._set: RobotSet[BaseParameters, Settings] = RobotSet(
            node, entry.name, f"{namespace}/base", entry.parameters, own.parameters, described, self._made, wait
        )

    @property
    def settings(self) -> Settings:
        """What the base is driven by."""
        return self._set.made

    @property
    def parameters(self) -> BaseParameters:
        """What the settings are made of."""
        return completed(self._model, self._set.params)

    def close(self) -> None:
        """Follow the set no more."""
        self._set.close()

    def follow(self) -> bool:
        """Take what was admitted; whether the settings are others now."""
        return self._set.follow()

    def change(self, asked: DriveSettings) -> None:
        """Set what is asked, for this run; raises BadInput or CallFailed with nothing changed."""
        told: dict[str, Any] = {
            name: value for name, value in msgspec.structs.asdict(asked).items() if value is not None
        }
        del told["name"]
        sides = "left_wheel_radius_multiplier", "right_wheel_radius_multiplier"
        both = self._set.params.wheel_radius_multiplier
        if both is not None and any(side in told for side in sides):
            # It wins over those of the sides, of which one is to change now.
            told = {"wheel_radius_multiplier": None, **dict.fromkeys(sides, both), **told}
        self._set.followed.change(told)

    def drive_settings(self) -> DriveSettings:
        """All that ``change`` can change."""
        return DriveSettings(name=self.name, **asdict(self.settings.live))

    def _as_built(self, one: ParameterDescription, own: BaseParameters) -> ParameterDescription:
        """What cannot change of this very robot is for the fleet to say, so that nobody is told of success in vain."""
        if (one.name.startswith("wheel_pid.") and not self._torque_driven) or (
            one.name == "brake_angular" and own.ramp != "base"
        ):
            return msgspec.structs.replace(one, live=False)
        return msgspec.structs.replace(one, optional=False) if one.name == "wheel_pid.p" else one

    def _made(self, parameters: BaseParameters) -> Settings:
        wheels = self._model.wheels
        assert wheels is not None
        if (parameters.wheel_pid is not None) != self._torque_driven:
            raise BadInput("wheel_pid: a base is driven by torque or by speed from its spawn on; only gains change")
        return base_settings(self._kind, self._model, wheels, completed(self._model, parameters))


def _own(entry: RobotEntry) -> Configured:
    try:
        return configured(entry.model, entry.parameters)
    except BadInput as error:
        raise BadInput(f"{entry.name}: {error}") from None
