"""The set of parameters of the joints of a model without wheels, ``NAMESPACE/joints``."""

from __future__ import annotations

from services.runtime.node import Node
from services.runtime.parameters.record import describe
from services.sim import JointParameters, RobotEntry
from services.sim.joints.terms import Terms, completed, terms_of
from services.sim.robot_set import RobotSet


class JointSet:
    """``terms`` follow from the parameters as they stand; whoever acts on joints takes them anew after a change."""

    def __init__(self, node: Node, namespace: str, entry: RobotEntry, wait: bool) -> None:
        model, given = entry.model, entry.joint_parameters
        self._set: RobotSet[JointParameters, Terms] = RobotSet(
            node,
            entry.name,
            f"{namespace}/joints",
            given,
            completed(model, given),
            tuple(describe(JointParameters, completed(model, JointParameters()))),
            lambda params: terms_of(model, params),
            wait,
        )

    @property
    def terms(self) -> Terms:
        """How the joints take efforts, and what they resist."""
        return self._set.made

    @property
    def noise(self) -> bool:
        """Whether sensors have any."""
        return self._set.params.noise

    def close(self) -> None:
        """Follow the set no more."""
        self._set.close()

    def follow(self) -> bool:
        """Take what was admitted; whether the terms are others now."""
        return self._set.follow()
