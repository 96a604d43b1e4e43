"""Shows the parameters of a dynamic_reconfigure server as a parameter set in the panel and ``./elea param``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from messages.base import LARGEST, WrongPayload, decoder, encode
from messages.parameters import Announcement, Assignment, ParameterDescription, ParameterValues, SetParameters
from messages.requests import PARAMS_ANNOUNCE, PARAMS_SET
from messages.rosparam import RosparamTree
from messages.topics import ROSPARAM_TREE, UPDATES
from services.script.api import Input, Origin, ServiceRefused, ServiceUnavailable
from services.script.reconfigure_config import BOOL, DOUBLE, INT, STR, Constant, enum_constants, extract_params

_TYPES = {BOOL: "bool", INT: "int", DOUBLE: "float", STR: "str"}
_MAX_TEXT = 1000
_read_values = decoder(ParameterValues)
_read_tree = decoder(RosparamTree)


class SetKernel(Protocol):
    """The set's interface to a script's kernel."""

    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None = None
    ) -> Input: ...
    def call(self, name: str, ros_type: str, payload: bytes, timeout: float | None = None) -> bytes: ...
    def service_type(self, name: str) -> str | None: ...
    def lock(self) -> Any: ...
    def log(self, level: int, text: str, where: Mapping[str, Any]) -> None: ...


class _Parameter(NamedTuple):
    """A parameter of the set, and the choices of its enum."""

    described: ParameterDescription
    choices: tuple[Constant, ...]

    def to_set(self, value: Any) -> Any:
        """Convert a value to the set's form: for an enum, the constant's name; None if it has none."""
        if self.choices and self.described.type == "str":
            return next((each.name for each in self.choices if each.value == value), None)
        if self.described.type == "float":
            return float(value) if math.isfinite(value) and abs(value) <= LARGEST else None
        return {"int": int, "bool": bool, "str": str}[self.described.type](value)

    def from_set(self, value: Any) -> Any:
        """Undo ``to_set``."""
        if self.choices:
            return next((each.value for each in self.choices if each.name == value), value)
        return value


class ReconfigureSet:
    """Announces a set, pushes changes made in ROS, and reports changes by others; does nothing without a service.

    Values set by the script apply to the run only; values set by people are saved, as in every set.

    Args:
        kernel: The script's kernel.
        node: The full name of its node.
        name: The name of the set.
        description: The module's ``config_description``.
        changed: Called with the values that the panel, ``./elea param`` or a schedule has changed; returns the
            configuration that applies.
    """

    def __init__(
        self,
        kernel: SetKernel,
        node: str,
        name: str,
        description: Mapping[str, Any],
        changed: Callable[[dict[str, Any]], Mapping[str, Any]],
    ) -> None:
        self._kernel, self._node, self.name, self._changed = kernel, node, name, changed
        self._parameters = {each["name"]: _parameter(each) for each in extract_params(description)}
        self._lock: Any = kernel.lock()
        self._fleet: dict[str, Any] = {}
        self._script_values: dict[str, Any] = {}
        """The script's values, in the set's form."""
        self._known: dict[str, Any] = {}
        """The values of the set, as last received or pushed."""
        self._published: dict[str, Any] = {}
        """The values of the last update; what differs in the next one was changed by someone."""
        self._run: set[str] = set()
        """Parameters that are set for the run only."""
        self._own_revisions: set[int] = set()
        self._newest = self._tree_revision = -1
        self._inputs: list[Input] = []

    def announce(self, fleet: Mapping[str, Any]) -> dict[str, Any]:
        """Announce the set, with the values from the launch file; return the effective values, none
        without a service.
        """
        self._fleet = dict(fleet)
        if self._kernel.service_type(PARAMS_ANNOUNCE.name) is None:
            return {}
        return self._announce({})

    def follow(self) -> None:
        """Subscribe to changes by others."""
        updates = f"{self.name}/{UPDATES.name.removeprefix('~')}"
        self._inputs = [
            self._kernel.subscribe(updates, ParameterValues.ROS_TYPE, self._receive),
            self._kernel.subscribe(ROSPARAM_TREE.name, RosparamTree.ROS_TYPE, self._see_service),
        ]

    def close(self) -> None:
        """Stop following."""
        for each in self._inputs:
            each.close()

    def push(self, config: Mapping[str, Any]) -> None:
        """Push the values of a configuration to the set."""
        with self._lock:
            self._script_values = self._to_set(config)
            news = {name: value for name, value in self._script_values.items() if self._known.get(name) != value}
            if not news or not self._known:
                return
            asked = SetParameters(set=self.name, values=_assignments(news), clamp=True, run=True, who=self._node)
            try:
                payload = self._kernel.call(PARAMS_SET.name, SetParameters.ROS_TYPE, encode(asked))
                answer = _read_values(payload)
            except (ServiceUnavailable, ServiceRefused, WrongPayload) as error:
                self._warn(f"a change was not passed on to the parameter set {self.name}: {error}")
                return
            self._own_revisions.add(answer.revision)
            self._known.update(news)
            self._run.update(news)

    def _announce(self, run: Mapping[str, Any]) -> dict[str, Any]:
        asked = Announcement(
            set=self.name,
            node=self._node,
            parameters=tuple(each.described for each in self._parameters.values()),
            fleet=_assignments(self._to_set(self._fleet)),
            run=_assignments(run),
        )
        try:
            answer = _read_values(self._kernel.call(PARAMS_ANNOUNCE.name, Announcement.ROS_TYPE, encode(asked)))
        except (ServiceUnavailable, ServiceRefused, WrongPayload) as error:
            self._warn(f"the parameter set {self.name} could not be announced: {error}")
            return {}
        self._known = self._values(answer)
        self._published, self._run = dict(self._known), _run_names(answer)
        self._own_revisions, self._newest = {answer.revision}, answer.revision
        return self._from_set(self._known)

    def _receive(self, payload: bytes, _: Origin) -> None:
        """Apply an update of the set to the configuration, unless it was this script's own."""
        try:
            news = _read_values(payload)
        except WrongPayload:
            return
        with self._lock:
            own = news.revision in self._own_revisions
            if own or (news.revision <= self._newest and news.values):
                self._own_revisions.discard(news.revision)
                if news.revision > self._newest:
                    self._newest, self._published = news.revision, self._values(news)
                return
            self._newest = news.revision
            before, self._published = self._published, self._values(news)
            changes = {name: value for name, value in self._published.items() if before.get(name) != value}
            self._known.update(changes)
            self._run = _run_names(news)
        if changes:
            config = self._changed(self._from_set(changes))
            self.push(config)

    def _see_service(self, payload: bytes, _: Origin) -> None:
        """Announce the set to a parameter service that has appeared or restarted."""
        try:
            revision = _read_tree(payload).revision
        except WrongPayload:
            return
        with self._lock:
            new = revision < self._tree_revision or not self._known
            self._tree_revision = revision
            values = self._announce(self._run_values()) if new and self._parameters else {}
        if values:
            self.push(self._changed(values))

    def _run_values(self) -> dict[str, Any]:
        """Return the values that a new parameter service cannot know from its file."""
        if self._known:
            return {name: value for name, value in self._known.items() if name in self._run}
        launched = self._to_set(self._fleet)
        stated = {name: launched.get(name, each.described.default) for name, each in self._parameters.items()}
        return {name: value for name, value in self._script_values.items() if stated[name] != value}

    def _values(self, news: ParameterValues) -> dict[str, Any]:
        return {each.name: each.value for each in news.values if each.name in self._parameters}

    def _to_set(self, config: Mapping[str, Any]) -> dict[str, Any]:
        made = {name: each.to_set(config[name]) for name, each in self._parameters.items() if name in config}
        return {name: value for name, value in made.items() if value is not None}

    def _from_set(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: self._parameters[name].from_set(value) for name, value in values.items()}

    def _warn(self, text: str) -> None:
        self._kernel.log(4, text, {})


def _parameter(stated: Mapping[str, Any]) -> _Parameter:
    """Convert a parameter of a ``.cfg`` file to one of a set."""
    kind, choices = stated["type"], enum_constants(stated)
    low, high = (_bound(stated[each]) if kind in (INT, DOUBLE) else None for each in ("min", "max"))
    default = stated["default"]
    if kind in (INT, DOUBLE):
        default = min(max(default, stated["min"]), stated["max"])
    text = str(stated["description"])
    named: dict[str, str] = {}
    for each in choices:
        named.setdefault(each.name, str(each.value))
    if choices and kind != BOOL and any(each.value == default for each in choices):
        default = next(each.name for each in choices if each.value == default)
        meaning = ", ".join(f"{each.name} ({each.value}): {each.description}" for each in choices)
        text = f"{text.rstrip('.')}. {meaning}"
        kind, low, high = STR, None, None
    else:
        choices, named = (), {}
    return _Parameter(
        ParameterDescription(
            name=stated["name"],
            type=_TYPES[kind],
            default=_bound(default) if kind == DOUBLE else default,
            low=low,
            high=high,
            choices=tuple(named),
            choice_values=tuple(named.values()),
            text=text[:_MAX_TEXT],
            level=int(stated["level"]) & 0xFFFFFFFF,
        ),
        choices,
    )


def _run_names(news: ParameterValues) -> set[str]:
    return {each.name for each in news.values if each.origin == "run"}


def _bound(value: float) -> float | None:
    """Return a finite number that a message can hold; None for infinity, which is not a bound."""
    return value if math.isfinite(value) and abs(value) <= LARGEST else None


def _assignments(values: Mapping[str, Any]) -> tuple[Assignment, ...]:
    return tuple(Assignment(name=name, value=value) for name, value in values.items())
