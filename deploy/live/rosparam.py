"""The tree of ROS 1's parameters from outside: what ``rosparam`` does."""

from __future__ import annotations

import json
from typing import Any

from messages.requests import ROSPARAM_DELETE, ROSPARAM_GET, ROSPARAM_HAS, ROSPARAM_NAMES, ROSPARAM_SEARCH, ROSPARAM_SET
from messages.rosparam import RosparamDelete, RosparamGet, RosparamKey, RosparamSearch, RosparamSet
from messages.std import Empty
from services.runtime.parameters.client import call_idempotent
from services.runtime.parameters.tree import checked_value, value_to_json
from services.runtime.transport.api import Transport


class RosparamClient:
    """Reads and changes the tree; keys are absolute. Each call raises CallFailed with the service's reason."""

    def __init__(self, transport: Transport, timeout: float = 5.0) -> None:
        self._transport, self._timeout = transport, timeout

    def get(self, key: str = "/") -> Any:
        """The value, or the dict of a branch."""
        answer = call_idempotent(self._transport, ROSPARAM_GET, RosparamGet(key=key), self._timeout)
        return json.loads(answer.value)

    def set(self, key: str, value: Any) -> None:
        """Set a value or, with a dict, a whole branch; raises BadInput for what is no parameter."""
        text = value_to_json(checked_value(key, value))
        call_idempotent(self._transport, ROSPARAM_SET, RosparamSet(key=key, value=text), self._timeout)

    def load(self, namespace: str, values: dict[str, Any]) -> None:
        """Set the values of a file in a namespace, as ``rosparam load``: what is beside them in the tree stays."""
        for name, value in values.items():
            key = f"{namespace.rstrip('/')}/{name}"
            if isinstance(value, dict) and value:
                self.load(key, value)
            else:
                self.set(key, value)

    def delete(self, key: str) -> None:
        """Delete a value or branch."""
        call_idempotent(self._transport, ROSPARAM_DELETE, RosparamDelete(key=key), self._timeout)

    def has(self, key: str) -> bool:
        """Whether there is a value or branch."""
        return call_idempotent(self._transport, ROSPARAM_HAS, RosparamKey(key=key), self._timeout).data

    def search(self, namespace: str, key: str) -> str | None:
        """The nearest key of this name, from the namespace upwards."""
        asked = RosparamSearch(namespace=namespace, key=key)
        return call_idempotent(self._transport, ROSPARAM_SEARCH, asked, self._timeout).key or None

    def names(self) -> tuple[str, ...]:
        """The names of all values."""
        return call_idempotent(self._transport, ROSPARAM_NAMES, Empty(), self._timeout).names
