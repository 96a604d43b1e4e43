"""The parameter set of one robot, ``NAMESPACE/base`` or ``NAMESPACE/joints``, and what is derived from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, Generic, Protocol, TypeVar

import msgspec

from messages.names import join
from messages.parameters import ParameterDescription
from messages.simulation import DriveSettings
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.schema import changed_names, flatten
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.parameters.validation import describe_parameters
from services.sim.drive.config import (
    DriveConfig,
    RobotConfig,
    drive_config,
    effective_parameters,
    robot_config,
    with_model_defaults,
)
from services.sim.joints.config import JointConfig, joint_config, with_urdf_defaults
from services.sim.parameters import BaseParameters, JointParameters, RobotEntry


class Derived(Protocol):
    """What follows from parameters; ``warnings`` name values that are probably mistakes."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line each."""


P = TypeVar("P", bound=Parameters)
D = TypeVar("D", bound=Derived)


class RobotParameterSet(Generic[P, D]):
    """``made`` follows from the current parameters; its users fetch it again when ``follow`` says so.

    ``given`` is what the fleet, or who spawned the robot, states; ``own`` is that completed by the model's figures,
    ``described`` has the figures alone as defaults. ``make`` raises BadInput for what contradicts itself.
    """

    def __init__(
        self,
        node: Node,
        robot: str,
        name: str,
        given: P,
        own: P,
        described: Sequence[ParameterDescription],
        make: Callable[[P], D],
        wait: bool,
    ) -> None:
        self._log, self._robot, self._derive = node.log, robot, make
        self.derived = make(own)
        stated = flatten(given)
        self.subscription = ParameterSubscription(
            node,
            name,
            own,
            fleet={each: stated[each] for each in changed_names(stated, flatten(type(given)()))},
            described=described,
            fits=make,
        )
        self.subscription.start(wait)
        if self.subscription.params is not own:
            self.derived = make(self.subscription.params)
        self._params = self.subscription.params
        self._warn(self.derived.warnings)

    @property
    def params(self) -> P:
        """What ``made`` is of."""
        return self._params

    def close(self) -> None:
        """Follow the set no more."""
        self.subscription.close()

    def update(self) -> bool:
        """Take what was admitted; whether anything is another now."""
        self.subscription.refresh()
        if self.subscription.params is self._params:
            return False
        before, self._params = self.derived.warnings, self.subscription.params
        self.derived = self._derive(self._params)
        self._warn(tuple(each for each in self.derived.warnings if each not in before))
        return True

    def _warn(self, warnings: tuple[str, ...]) -> None:
        for each in warnings:
            self._log.warn(f"{self._robot}: {each}")


class BaseParameterSet:
    """``settings`` follow from the current parameters; their users fetch them again after a change."""

    def __init__(self, node: Node, namespace: str, entry: RobotEntry, wait: bool) -> None:
        own = _robot_config(entry)
        assert own.drive_config is not None
        self.name, self._model, self._model_name = entry.name, own.model, entry.model
        self._torque_driven = own.drive_config.gains is not None
        figures = effective_parameters(entry.model, own.model, BaseParameters())
        described = [self._described(each, own.parameters) for each in describe_parameters(BaseParameters, figures)]
        self._set: RobotParameterSet[BaseParameters, DriveConfig] = RobotParameterSet(
            node, entry.name, join(namespace, "base"), entry.parameters, own.parameters, described, self._derive, wait
        )

    @property
    def config(self) -> DriveConfig:
        """What the base is driven by."""
        return self._set.derived

    @property
    def parameters(self) -> BaseParameters:
        """What the settings are made of."""
        return with_model_defaults(self._model, self._set.params)

    @property
    def subscription(self) -> ParameterSubscription[Any]:
        """Where changes come from."""
        return self._set.subscription

    def close(self) -> None:
        """Follow the set no more."""
        self._set.close()

    def update(self) -> bool:
        """Take what was admitted; whether the settings are others now."""
        return self._set.update()

    def set_drive(self, request: DriveSettings) -> None:
        """Set what is asked, for this run; raises BadInput or CallFailed with nothing changed."""
        changes: dict[str, Any] = {
            name: value for name, value in msgspec.structs.asdict(request).items() if value is not None
        }
        del changes["name"]
        sides = "left_wheel_radius_multiplier", "right_wheel_radius_multiplier"
        both = self._set.params.wheel_radius_multiplier
        if both is not None and any(side in changes for side in sides):
            # It wins over those of the sides, of which one is to change now.
            changes = {"wheel_radius_multiplier": None, **dict.fromkeys(sides, both), **changes}
        self._set.subscription.change(changes)

    def drive_settings(self) -> DriveSettings:
        """All that ``change`` can change."""
        return DriveSettings(name=self.name, **asdict(self.config.live))

    def _described(self, one: ParameterDescription, own: BaseParameters) -> ParameterDescription:
        """What cannot change of this very robot is for the fleet to say, so that nobody is told of success in vain."""
        if (one.name.startswith("wheel_pid.") and not self._torque_driven) or (
            one.name == "brake_angular" and own.ramp != "base"
        ):
            return msgspec.structs.replace(one, live=False)
        return msgspec.structs.replace(one, optional=False) if one.name == "wheel_pid.p" else one

    def _derive(self, parameters: BaseParameters) -> DriveConfig:
        if (parameters.wheel_pid is not None) != self._torque_driven:
            raise BadInput("wheel_pid: a base is driven by torque or by speed from its spawn on; only gains change")
        return drive_config(self._model_name, self._model, with_model_defaults(self._model, parameters))


def _robot_config(entry: RobotEntry) -> RobotConfig:
    try:
        return robot_config(entry.model, entry.parameters)
    except BadInput as error:
        raise BadInput(f"{entry.name}: {error}") from None


class JointParameterSet:
    """``terms`` follow from the current parameters; their users fetch them again after a change."""

    def __init__(self, node: Node, namespace: str, entry: RobotEntry, wait: bool) -> None:
        model, given = entry.model, entry.joint_parameters
        self._set: RobotParameterSet[JointParameters, JointConfig] = RobotParameterSet(
            node,
            entry.name,
            join(namespace, "joints"),
            given,
            with_urdf_defaults(model, given),
            tuple(describe_parameters(JointParameters, with_urdf_defaults(model, JointParameters()))),
            lambda params: joint_config(model, params),
            wait,
        )

    @property
    def config(self) -> JointConfig:
        """How the joints take efforts, and what they resist."""
        return self._set.derived

    @property
    def noise(self) -> bool:
        """Whether sensors have any."""
        return self._set.params.noise

    @property
    def subscription(self) -> ParameterSubscription[Any]:
        """Where changes come from."""
        return self._set.subscription

    def close(self) -> None:
        """Follow the set no more."""
        self._set.close()

    def update(self) -> bool:
        """Take what was admitted; whether the terms are others now."""
        return self._set.update()
