"""What the shell offers at the TAB key: names asked of the network, which has 300 ms to answer, and of the files."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from services.runtime.errors import EleaError

if TYPE_CHECKING:
    from services.runtime.network.transport import Transport

WITHIN_S = 0.3
"""Wall time that the network has; a shell must not hang because a router does."""

Source = Callable[[click.Context, str], Iterable[str]]
"""The candidates, from what was typed before and the beginning of this word."""


class Name(click.ParamType[str]):
    """A word that is taken as it is, with completion from a source."""

    def __init__(self, name: str, source: Source) -> None:
        self.name, self._source = name, source

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem[Any]]:
        """The candidates that begin like the word; none when they cannot be known."""
        try:
            found = sorted(set(self._source(ctx, incomplete)))
        except EleaError:
            return []
        return [CompletionItem(each) for each in found if each.startswith(incomplete)]


def ask(ctx: click.Context, question: Callable[[Transport], Iterable[str]]) -> list[str]:
    """What the network that the command line names answers within WITHIN_S; nothing when it does not."""
    answer: list[str] = []

    def visit_and_ask() -> None:
        from deploy.live.visit import visit
        from deploy.place import place_of

        given = {name: ctx.params.get(name) for name in ("connect", "domain", "port")}
        try:
            place = place_of(given["connect"] or "", given["domain"] or "", given["port"])
            with visit(place.router, place.domain, WITHIN_S) as transport:
                answer.extend(question(transport))
        except EleaError:
            return

    asking = threading.Thread(target=visit_and_ask, daemon=True)
    asking.start()
    asking.join(WITHIN_S)
    return list(answer)


def _topics(ctx: click.Context, begun: str) -> list[str]:
    def question(transport: Transport) -> Iterable[str]:
        from deploy.live.ends import topics
        from services.runtime.graph import snapshot

        return topics(snapshot(transport))

    return _as_begun(ask(ctx, question), begun)


def _nodes(ctx: click.Context, begun: str) -> list[str]:
    return _as_begun(_entities(ctx, "node", lambda each: each.node), begun)


def _services(ctx: click.Context, begun: str) -> list[str]:
    return _as_begun(_entities(ctx, "srv", lambda each: each.name), begun)


def _entities(ctx: click.Context, kind: Any, name: Callable[[Any], str]) -> list[str]:
    def question(transport: Transport) -> Iterable[str]:
        from services.runtime.graph import Entity, pattern

        found = (Entity.parse(each) for each in transport.tokens(pattern(kind), WITHIN_S))
        return [name(each) for each in found if each and not each.node.rpartition("/")[2].startswith("_")]

    return ask(ctx, question)


def _types(ctx: click.Context, begun: str) -> list[str]:
    from messages.records import RECORDS

    if "/msg/" not in begun:
        return list(RECORDS)
    return ["/msg/".join(each.split("/")) for each in RECORDS]


def _type_or_values(ctx: click.Context, begun: str) -> list[str]:
    return [] if ctx.params.get("values") else _types(ctx, begun)


def _fields(ctx: click.Context, begun: str) -> list[str]:
    from deploy.live.ends import absolute
    from deploy.live.fields import completions
    from deploy.live.known import topic_of

    # An option whose value is being typed keeps click from giving the arguments their names.
    topic = topic_of(absolute(ctx.params.get("topic") or next(iter(ctx.args), "")))
    return [] if topic is None else completions(topic.record, begun)


def _fleets(ctx: click.Context, begun: str) -> list[str]:
    from deploy.fleet_file import fleet_names

    return list(fleet_names())


def _kinds(ctx: click.Context, begun: str) -> list[str]:
    from deploy.catalogue import kinds

    return list(kinds())


def _processes(ctx: click.Context, begun: str) -> list[str]:
    from pathlib import Path

    from deploy.claim import running
    from deploy.run_folder import read_state

    port = ctx.params.get("port")
    states = [read_state(Path(each.folder)) for each in running() if port in (None, each.port)]
    return [process.name for state in states if state for process in state.processes]


def _sets(ctx: click.Context, begun: str) -> list[str]:
    def question(transport: Transport) -> Iterable[str]:
        return [each.set for each in _described(transport)]

    return _as_begun(ask(ctx, question), begun)


def _parameters(ctx: click.Context, begun: str) -> list[str]:
    wanted = "/" + str(ctx.params.get("set") or ctx.params.get("set_name") or "").removeprefix("/")

    def question(transport: Transport) -> Iterable[str]:
        return [one.name for each in _described(transport) if each.set == wanted for one in each.parameters]

    return ask(ctx, question)


def _described(transport: Transport) -> Iterable[Any]:
    from messages.names import key
    from messages.requests import PARAMS_LIST
    from messages.std import Empty
    from services.runtime.calls import call

    return call(transport, PARAMS_LIST, key(PARAMS_LIST.name), Empty(), WITHIN_S).sets


def _as_begun(names: Iterable[str], begun: str) -> list[str]:
    """Names as the person writes them, with or without the first slash."""
    return [each if not begun or begun.startswith("/") else each.removeprefix("/") for each in names]


TOPIC = Name("topic", _topics)
NODE = Name("node", _nodes)
SERVICE = Name("service", _services)
TYPE = Name("type", _types)
TYPE_OR_VALUES = Name("type or values", _type_or_values)
FIELD = Name("field", _fields)
FLEET = Name("fleet", _fleets)
KIND = Name("service", _kinds)
PROCESS = Name("process", _processes)
SET = Name("set", _sets)
PARAMETER = Name("parameter", _parameters)
"""A parameter of the set that the argument ``set`` (or ``set_name``) names."""
