"""Options and calls of verbs that ask a running fleet something, and how they print what it says."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Self, TypeVar

import click

from deploy.commands.options import json_option, place_options
from deploy.live.output import say
from deploy.place import Place

if TYPE_CHECKING:
    from messages.base import Message
    from messages.requests import Request
    from services.runtime.network.transport import Transport

R = TypeVar("R", bound="Message")

TIMEOUT_S = 5.0
"""Wall time that a request may take unless told otherwise."""


class Asker:
    """Asks the services of one fleet, which it joins at the first question, and prints what they say."""

    def __init__(self, place: Place, timeout: float, as_json: bool) -> None:
        self._place, self._timeout, self._as_json = place, timeout, as_json
        self._visit = ExitStack()
        self._transport: Transport | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._visit.close()

    def ask(self, request: Request[Any, R], message: Message) -> R:
        """The reply to one request; raises CallFailed with the reason, BadInput when no router is there."""
        from deploy.live.visit import visit
        from messages.names import key
        from services.runtime.calls import call

        if self._transport is None:
            self._transport = self._visit.enter_context(visit(self._place.router, self._place.domain))
        return call(self._transport, request, key(request.name), message, self._timeout)

    def show(self, reply: Message | Iterable[Message], text: str) -> None:
        """Print the reply as JSON, or the text that says it."""
        if not self._as_json:
            say(f"{text}\n" if text else "")
            return
        import msgspec

        plain = msgspec.to_builtins(reply)
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(plain), indent=2).decode() + "\n")


def asks(command: Callable[..., Any]) -> Callable[..., Any]:
    """Gives a command ``--connect``, ``--domain``, ``--port``, ``--timeout`` and ``--json``, and itself an Asker."""

    @click.option(
        "--timeout", type=click.FloatRange(0, min_open=True), default=TIMEOUT_S, help="Wall time to wait, s; 5."
    )
    @place_options
    @json_option
    @functools.wraps(command)
    def wrapped(place: Place, timeout: float, as_json: bool, **given: Any) -> Any:
        with Asker(place, timeout, as_json) as asker:
            return command(asker, **given)

    return wrapped


def table(rows: Iterable[Iterable[str]]) -> str:
    """Rows of words in columns that are as wide as they need to be."""
    lines = [list(row) for row in rows]
    widths = [max(len(row[column]) for row in lines) for column in range(len(lines[0]))] if lines else []
    return "\n".join(
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip() for row in lines
    )


def assignments(pairs: Iterable[str]) -> dict[str, float]:
    """``name=number`` words as a table; raises click's own error for another form."""
    found: dict[str, float] = {}
    for pair in pairs:
        name, equals, value = pair.rpartition("=")
        try:
            found[name] = float(value)
        except ValueError:
            equals = ""
        if not equals or not name:
            raise click.BadParameter(f"{pair!r}: write it as joint=position, in rad or m")
    return found
