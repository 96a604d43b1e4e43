"""The parameter set of one robot, ``NAMESPACE/base`` or ``NAMESPACE/joints``, and the configuration derived from it."""

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
    """A configuration derived from parameters; ``warnings`` name values that are probably mistakes."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line each."""


P = TypeVar("P", bound=Parameters)
D = TypeVar("D", bound=Derived)


class RobotParameterSet(Generic[P, D]):
    """``derived`` is computed from the current parameters; re-read it whenever ``update`` returns True.

    Args:
        node: The simulation's node.
        robot: The robot's name, for warnings.
        name: The name of the set.
        given: The values stated by the fleet, or by the spawn request.
        own: ``given`` completed by the model's values.
        described: Descriptions with the model's values as defaults.
        make: Derives the configuration; raises BadInput for contradictory values.
        wait: Wait for the values of the parameter service.
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
            validate=make,
        )
        self.subscription.start(wait)
        if self.subscription.params is not own:
            self.derived = make(self.subscription.params)
        self._params = self.subscription.params
        self._warn(self.derived.warnings)

    @property
    def params(self) -> P:
        """The parameters that ``derived`` is computed from."""
        return self._params

    def close(self) -> None:
        """Unsubscribe from the set."""
        self.subscription.close()

    def update(self) -> bool:
        """Apply the admitted changes; return whether there were any."""
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
    """The parameters of a base. ``config`` is derived from them; re-read it whenever ``update`` returns True."""

    def __init__(self, node: Node, namespace: str, entry: RobotEntry, wait: bool) -> None:
        own = _robot_config(entry)
        assert own.drive_config is not None
        self.name, self._model, self._model_name = entry.name, own.model, entry.model
        self._torque_driven = own.drive_config.gains is not None
        defaults = effective_parameters(entry.model, own.model, BaseParameters())
        described = [self._described(each, own.parameters) for each in describe_parameters(BaseParameters, defaults)]
        self._set: RobotParameterSet[BaseParameters, DriveConfig] = RobotParameterSet(
            node, entry.name, join(namespace, "base"), entry.parameters, own.parameters, described, self._derive, wait
        )

    @property
    def config(self) -> DriveConfig:
        """The drive configuration."""
        return self._set.derived

    @property
    def parameters(self) -> BaseParameters:
        """The parameters that ``config`` is derived from."""
        return with_model_defaults(self._model, self._set.params)

    @property
    def subscription(self) -> ParameterSubscription[Any]:
        """The source of changes."""
        return self._set.subscription

    def close(self) -> None:
        """Unsubscribe from the set."""
        self._set.close()

    def update(self) -> bool:
        """Apply the admitted changes; return whether there were any."""
        return self._set.update()

    def set_drive(self, request: DriveSettings) -> None:
        """Set the requested values for this run; raises BadInput or CallFailed, and then changes nothing."""
        changes: dict[str, Any] = {
            name: value for name, value in msgspec.structs.asdict(request).items() if value is not None
        }
        del changes["name"]
        sides = "left_wheel_radius_multiplier", "right_wheel_radius_multiplier"
        both = self._set.params.wheel_radius_multiplier
        if both is not None and any(side in changes for side in sides):
            # It overrides the multipliers of the sides, one of which is to change now.
            changes = {"wheel_radius_multiplier": None, **dict.fromkeys(sides, both), **changes}
        self._set.subscription.change(changes)

    def drive_settings(self) -> DriveSettings:
        """Return all values that ``set_drive`` can change."""
        return DriveSettings(name=self.name, **asdict(self.config.live))

    def _described(self, one: ParameterDescription, own: BaseParameters) -> ParameterDescription:
        """Mark parameters that this robot cannot change at run time as not live, so that setting them is refused."""
        if (one.name.startswith("wheel_pid.") and not self._torque_driven) or (
            one.name == "brake_angular" and own.ramp != "base"
        ):
            return msgspec.structs.replace(one, live=False)
        return msgspec.structs.replace(one, optional=False) if one.name == "wheel_pid.p" else one

    def _derive(self, parameters: BaseParameters) -> DriveConfig:
        if (parameters.wheel_pid is not None) != self._torque_driven:
            raise BadInput("wheel_pid: it cannot be added or removed after the spawn; only its gains can change")
        return drive_config(self._model_name, self._model, with_model_defaults(self._model, parameters))


def _robot_config(entry: RobotEntry) -> RobotConfig:
    try:
        return robot_config(entry.model, entry.parameters)
    except BadInput as error:
        raise BadInput(f"{entry.name}: {error}") from None


class JointParameterSet:
    """The parameters of joints. ``config`` is derived from them; re-read it whenever ``update`` returns True."""

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
        """The effort rule, and the friction of the joints."""
        return self._set.derived

    @property
    def noise(self) -> bool:
        """Whether sensors have noise."""
        return self._set.params.noise

    @property
    def subscription(self) -> ParameterSubscription[Any]:
        """The source of changes."""
        return self._set.subscription

    def close(self) -> None:
        """Unsubscribe from the set."""
        self._set.close()

    def update(self) -> bool:
        """Apply the admitted changes; return whether there were any."""
        return self._set.update()
