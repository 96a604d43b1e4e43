"""A script's view of the ROS 1 parameter tree: a copy that follows the parameter service's."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from messages.base import Message, WrongPayload, decoder, encode
from messages.requests import ROSPARAM_DELETE, ROSPARAM_GET, ROSPARAM_SET, Request
from messages.rosparam import RosparamDelete, RosparamGet, RosparamSet, RosparamTree, RosparamValue
from messages.topics import ROSPARAM_TREE
from services.runtime.errors import BadInput
from services.runtime.parameters.client import AWAIT_S, DISCOVERY_S
from services.runtime.parameters.tree import ParameterTree, checked_value, value_to_json
from services.script.api import Input, Origin, ServiceRefused, ServiceUnavailable

_PAUSE_S = 0.02
_read_tree = decoder(RosparamTree)
_read_value = decoder(RosparamValue)


class TreeKernel(Protocol):
    """The tree's interface to a script's kernel."""

    lockstep: bool

    @property
    def time_has_begun(self) -> bool: ...
    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None = None
    ) -> Input: ...
    def call(self, name: str, ros_type: str, payload: bytes, timeout: float | None = None) -> bytes: ...
    def service_type(self, name: str) -> str | None: ...
    def now(self) -> int: ...
    def lock(self) -> Any: ...


class _Write(NamedTuple):
    """A change by this script: its number, the key, and the value, unless it deletes."""

    number: int
    key: str
    value: Any
    deletes: bool


class SharedParameters:
    """``services.script.api.Parameters``: reads from a copy of the published tree, and writes through.

    Own writes are visible at once: those that a published tree does not contain yet are applied again on top of it.
    Without a parameter service the script has its own tree, which is sent to the service if it appears. One that
    restarts with an empty tree gets this script's values again.

    Args:
        kernel: The script's kernel.
        writer: Returns the name under which changes are counted, that of the node; called at the first access.
        expected: Whether a parameter service runs or will start.
    """

    def __init__(self, kernel: TreeKernel, writer: Callable[[], str], expected: bool = False) -> None:
        self._kernel, self._name, self._expected = kernel, writer, expected
        self._tree = ParameterTree()
        self._state = threading.RLock()  # reentrant, for a signal may run a shutdown hook meanwhile
        self._connecting: Any = kernel.lock()
        self._input: Input | None = None
        self._connected = self._shared = False
        self._writer, self._number = "", 0
        self._fetched, self._revision = 0, 0
        self._pending: list[_Write] = []
        self._own: dict[str, _Write] = {}

    def get(self, key: str) -> Any:
        """Return the value, or the dict of an inner node; raises KeyError."""
        self._connect()
        with self._state:
            return self._tree.get(key)

    def set(self, key: str, value: Any) -> None:
        """Set a value or, with a dict, a whole branch; raises BadInput for an invalid parameter."""
        checked = checked_value(key, value)
        if not key.strip("/") and not isinstance(checked, dict):
            raise BadInput("/: the root of the tree must be a map of names to values")
        self._write(key, checked, deletes=False)

    def delete(self, key: str) -> None:
        """Delete a value or branch; raises KeyError."""
        self._connect()
        with self._state:
            if not self._tree.has(key):
                raise KeyError(key)
        if not key.strip("/"):
            raise KeyError("cannot delete root of parameter tree")
        self._write(key, None, deletes=True)

    def has(self, key: str) -> bool:
        """Return whether there is a value or branch."""
        self._connect()
        with self._state:
            return self._tree.has(key)

    def search(self, namespace: str, key: str) -> str | None:
        """Return the nearest key of this name, from the namespace upwards."""
        self._connect()
        with self._state:
            return self._tree.search(namespace, key)

    def names(self) -> list[str]:
        """Return the names of all values, in the order in which they were set."""
        self._connect()
        with self._state:
            return self._tree.names()

    def _connect(self) -> None:
        if self._connected:
            return
        with self._connecting:
            if self._connected:
                return
            self._writer = self._name() or "unnamed"
            deadline = time.monotonic() + (AWAIT_S if self._expected else DISCOVERY_S)
            while not (found := self._kernel.service_type(ROSPARAM_GET.name)) and time.monotonic() < deadline:
                time.sleep(_PAUSE_S)
            if found:
                self._fetch()
            self._connected = True
            self._input = self._kernel.subscribe(ROSPARAM_TREE.name, RosparamTree.ROS_TYPE, self._receive)

    def _fetch(self) -> None:
        """Fetch the current tree."""
        try:
            reply = _read_value(self._call(ROSPARAM_GET, RosparamGet(key="/", writer=self._writer)))
        except (ServiceUnavailable, ServiceRefused, WrongPayload):
            return
        with self._state:
            self._tree = ParameterTree.from_json(reply.value)
            self._number = max(self._number, reply.number)
            self._fetched, self._shared = reply.revision, True
            for each in self._pending:
                _make(self._tree, each)

    def _write(self, key: str, value: Any, *, deletes: bool) -> None:
        self._connect()
        with self._state:
            self._number += 1
            write = _Write(self._number, key, value, deletes)
            _make(self._tree, write)
            shared = self._shared
            if shared:  # without a service, all of _own is sent once there is one
                self._pending.append(write)
            self._own.pop(key, None)
            self._own[key] = write
        if not shared:
            return
        try:
            self._send(write)
        except ServiceRefused as error:
            with self._state:
                self._pending = [each for each in self._pending if each is not write]
                self._own.pop(key, None)
            self._fetch()
            raise BadInput(str(error)) from None
        except ServiceUnavailable:
            return  # The service gets the value when it is back.

    def _send(self, write: _Write) -> None:
        now = self._time()
        if write.deletes:
            deletion = RosparamDelete(key=write.key, writer=self._writer, number=write.number, time=now)
            self._call(ROSPARAM_DELETE, deletion)
        else:
            text = value_to_json(write.value)
            self._call(
                ROSPARAM_SET,
                RosparamSet(key=write.key, value=text, writer=self._writer, number=write.number, time=now),
            )

    def _time(self) -> int | None:
        """Return the time of a change [ns] in lockstep: 0 before time has begun, positive afterwards."""
        if not self._kernel.lockstep:
            return None
        return max(1, self._kernel.now()) if self._kernel.time_has_begun else 0

    def _call(self, request: Request[Any, Any], message: Message) -> bytes:
        return self._kernel.call(request.name, request.request_type.ROS_TYPE, encode(message))

    def _receive(self, payload: bytes, _: Origin) -> None:
        """Replace the tree by the published one, with the script's own changes that it does not contain yet."""
        try:
            news = _read_tree(payload)
            tree = ParameterTree.from_json(news.tree)
        except (WrongPayload, BadInput):
            return
        done = next((each.number for each in news.writers if each.node == self._writer), 0)
        with self._state:
            if not self._revision and news.revision < self._fetched:
                return  # It was published before the tree was fetched.
            restarted = not self._shared or news.revision < self._revision
            self._pending = list(self._own.values()) if restarted else [e for e in self._pending if e.number > done]
            for each in self._pending:
                _make(tree, each)
            self._tree, self._revision, self._shared = tree, news.revision, True
            missing = tuple(self._pending) if restarted else ()
        for each in missing:
            try:
                self._send(each)
            except (ServiceRefused, ServiceUnavailable):
                return


def _make(tree: ParameterTree, write: _Write) -> None:
    if not write.deletes:
        tree.set(write.key, write.value)
    elif tree.has(write.key):
        tree.delete(write.key)
