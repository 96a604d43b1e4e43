"""A set of parameters that one robot in the world follows, and what is made of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from messages.parameters import ParameterDescription
from services.runtime.node import Node
from services.runtime.parameters.followed import Followed
from services.runtime.parameters.leaves import differing, flatten
from services.runtime.service import Parameters


class Made(Protocol):
    """What follows from parameters; ``warnings`` are what of it is hardly meant so."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line each."""


P = TypeVar("P", bound=Parameters)
M = TypeVar("M", bound=Made)


class RobotSet(Generic[P, M]):
    """``made`` is of the parameters as they stand; whoever works by it takes it anew when ``follow`` says so.

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
        make: Callable[[P], M],
        wait: bool,
    ) -> None:
        self._log, self._robot, self._make = node.log, robot, make
        self.made = make(own)
        stated = flatten(given)
        self.followed = Followed(
            node,
            name,
            own,
            fleet={each: stated[each] for each in differing(stated, flatten(type(given)()))},
            described=described,
            fits=make,
        )
        self.followed.begin(wait)
        if self.followed.params is not own:
            self.made = make(self.followed.params)
        self._seen = self.followed.params
        self._warn(self.made.warnings)

    @property
    def params(self) -> P:
        """What ``made`` is of."""
        return self._seen

    def close(self) -> None:
        """Follow the set no more."""
        self.followed.close()

    def follow(self) -> bool:
        """Take what was admitted; whether anything is another now."""
        self.followed.refresh()
        if self.followed.params is self._seen:
            return False
        before, self._seen = self.made.warnings, self.followed.params
        self.made = self._make(self._seen)
        self._warn(tuple(each for each in self.made.warnings if each not in before))
        return True

    def _warn(self, warnings: tuple[str, ...]) -> None:
        for each in warnings:
            self._log.warn(f"{self._robot}: {each}")
