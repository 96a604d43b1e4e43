"""Client of the parameter service for programs without a node, such as the command line."""

from __future__ import annotations

import getpass
import socket
import uuid
from contextlib import suppress
from typing import Literal

from messages.parameters import (
    Assignment,
    HistoryOf,
    ParameterChange,
    ParameterSchema,
    ParameterSet,
    ParameterValues,
    ResetParameters,
    SetParameters,
    UndoParameters,
)
from messages.requests import PARAMS_GET, PARAMS_HISTORY, PARAMS_LIST, PARAMS_RESET, PARAMS_SET, PARAMS_UNDO
from messages.std import Empty
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.client import call_idempotent
from services.runtime.transport.api import Transport


class ParameterServiceClient:
    """Calls the parameter service. Changes are repeated with the same id until they are answered."""

    def __init__(self, transport: Transport, timeout: float) -> None:
        self._transport, self._timeout = transport, timeout
        self._who = f"{_user_at_host()} (param)"

    def sets(self) -> dict[str, ParameterSchema]:
        """Return all sets by name."""
        listed = call_idempotent(self._transport, PARAMS_LIST, Empty(), self._timeout).sets
        return {each.set: each for each in listed}

    def find_set(self, name: str) -> ParameterSchema:
        """Return the set with this name or node; raises BadInput with the nearest name."""
        return find_set(name, self.sets())

    def find_parameter(self, path: str) -> tuple[ParameterSchema, str]:
        """Return the set in ``path``, and the parameter's name if it is ``/SET/NAME``, else an empty text."""
        sets = self.sets()
        try:
            return find_set(path, sets), ""
        except BadInput:
            before, _, name = path.rstrip("/").rpartition("/")
            with suppress(BadInput):
                return find_set(before, sets), name
            raise  # the error for the whole path

    def values(self, name: str) -> ParameterValues:
        """Return the effective values of a set."""
        return call_idempotent(self._transport, PARAMS_GET, ParameterSet(set=name), self._timeout)

    def set(
        self, name: str, values: tuple[Assignment, ...], clamp: bool, run: bool, kind: Literal["set", "load"] = "set"
    ) -> ParameterValues:
        """Set parameters, all or none.

        Args:
            name: The set.
            values: The new values.
            clamp: Whether to clamp values to their bounds instead of refusing them.
            run: Whether they apply to this run only and are not saved.
            kind: The kind of the change in the history.
        """
        asked = SetParameters(set=name, values=values, clamp=clamp, run=run, kind=kind, id=_new_id(), who=self._who)
        return call_idempotent(self._transport, PARAMS_SET, asked, self._timeout)

    def reset(self, name: str, names: tuple[str, ...]) -> ParameterValues:
        """Reset parameters."""
        asked = ResetParameters(set=name, names=names, id=_new_id(), who=self._who)
        return call_idempotent(self._transport, PARAMS_RESET, asked, self._timeout)

    def undo(self, name: str) -> ParameterValues:
        """Undo the last change."""
        asked = UndoParameters(set=name, id=_new_id(), who=self._who)
        return call_idempotent(self._transport, PARAMS_UNDO, asked, self._timeout)

    def history(self, name: str, limit: int) -> tuple[ParameterChange, ...]:
        """Return the newest changes."""
        return call_idempotent(self._transport, PARAMS_HISTORY, HistoryOf(set=name, limit=limit), self._timeout).changes


def find_set(name: str, sets: dict[str, ParameterSchema]) -> ParameterSchema:
    """Return the set with this name or, if unambiguous, the one that a node of this name uses or that ends with it.

    Raises:
        BadInput: No set fits, with the nearest name, or several do.
    """
    absolute = f"/{name.strip('/')}"
    if absolute in sets:
        return sets[absolute]
    followed = [each for each in sets.values() if absolute in each.nodes]
    if len(followed) == 1:
        return followed[0]
    if followed:
        raise BadInput(f"{absolute} uses several sets: which one? {', '.join(each.set for each in followed)}")
    below = [each for each in sets if each.endswith(absolute)]
    if len(below) == 1:
        return sets[below[0]]
    if below:
        raise BadInput(f"{name!r} may be one of several sets: choose one of {', '.join(sorted(below))}")
    raise unknown_name("set of parameters", absolute, sets)


def _new_id() -> str:
    return uuid.uuid4().hex


def _user_at_host() -> str:
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = "unknown"
    return f"{user}@{socket.gethostname()}"[:200]
