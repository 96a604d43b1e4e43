"""Shell completion: names asked of the network, which has 300 ms to answer, and of files; scripts for zsh and fish.

Click's own scripts ask ``elea``, wherever the shell finds that; these ask the ``./elea`` of this project by its place.
Click's script for bash asks the command as it was typed, and serves as it is.
"""

from __future__ import annotations

import shlex
import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem, FishComplete, ZshComplete, add_completion_class

from services.runtime.errors import EleaError
from services.runtime.process import ROOT

if TYPE_CHECKING:
    from services.runtime.transport.api import Transport

_PROGRAM = shlex.quote(str(ROOT / "elea"))
_IN_PATH = "    (( ! $+commands[%(prog_name)s] )) && return 1\n"


class ProjectZshComplete(ZshComplete):
    """Completion in zsh by the script's place."""

    source_template = ZshComplete.source_template.replace(_IN_PATH, "").replace(
        "_complete %(prog_name)s", f"_complete {_PROGRAM.replace('%', '%%')}"
    )


class ProjectFishComplete(FishComplete):
    """Completion in fish by the script's place."""

    source_template = FishComplete.source_template.replace(
        "(commandline -t) %(prog_name)s", f"(commandline -t) {_PROGRAM.replace('%', '%%')}"
    )


def register_shells() -> None:
    """Let click take these scripts."""
    add_completion_class(ProjectZshComplete)
    add_completion_class(ProjectFishComplete)


TIMEOUT_S = 0.3
"""Wall time that the network has; a shell must not hang because a router does."""

Source = Callable[[click.Context, str], Iterable[str]]
"""The candidates, from what was typed before and the beginning of this word."""


class CompletingParam(click.ParamType[str]):
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


def query_network(ctx: click.Context, question: Callable[[Transport], Iterable[str]]) -> list[str]:
    """What the network that the command line names answers within WITHIN_S; nothing when it does not."""
    answer: list[str] = []

    def visit_and_ask() -> None:
        from deploy.live.connect import connect
        from deploy.network_address import resolve_address

        given = {name: ctx.params.get(name) for name in ("connect", "domain", "port")}
        try:
            place = resolve_address(given["connect"] or "", given["domain"] or "", given["port"])
            with connect(place.router, place.domain, TIMEOUT_S) as transport:
                answer.extend(question(transport))
        except EleaError:
            return

    asking = threading.Thread(target=visit_and_ask, daemon=True)
    asking.start()
    asking.join(TIMEOUT_S)
    return list(answer)


def _topics(ctx: click.Context, begun: str) -> list[str]:
    def question(transport: Transport) -> Iterable[str]:
        from deploy.live.topics import group_by_topic
        from services.runtime.graph import snapshot

        return group_by_topic(snapshot(transport))

    return _with_typed_slash(query_network(ctx, question), begun)


def _nodes(ctx: click.Context, begun: str) -> list[str]:
    return _with_typed_slash(_entities(ctx, "node", lambda each: each.node), begun)


def _services(ctx: click.Context, begun: str) -> list[str]:
    return _with_typed_slash(_entities(ctx, "srv", lambda each: each.name), begun)


def _entities(ctx: click.Context, kind: Any, name: Callable[[Any], str]) -> list[str]:
    def question(transport: Transport) -> Iterable[str]:
        from services.runtime.graph import Entity, token_pattern

        found = (Entity.parse(each) for each in transport.tokens(token_pattern(kind), TIMEOUT_S))
        return [name(each) for each in found if each and not each.node.rpartition("/")[2].startswith("_")]

    return query_network(ctx, question)


def _types(ctx: click.Context, begun: str) -> list[str]:
    from messages.records import RECORDS

    if "/msg/" not in begun:
        return list(RECORDS)
    return ["/msg/".join(each.split("/")) for each in RECORDS]


def _type_or_values(ctx: click.Context, begun: str) -> list[str]:
    return [] if ctx.params.get("values") else _types(ctx, begun)


def _fields(ctx: click.Context, begun: str) -> list[str]:
    from deploy.live.message_types import complete_path, known_topic
    from deploy.live.topics import absolute_name

    # An option whose value is being typed keeps click from giving the arguments their names.
    topic = known_topic(absolute_name(ctx.params.get("topic") or next(iter(ctx.args), "")))
    return [] if topic is None else complete_path(topic.record, begun)


def _fleets(ctx: click.Context, begun: str) -> list[str]:
    from deploy.fleet_file import fleet_names

    return list(fleet_names())


def _kinds(ctx: click.Context, begun: str) -> list[str]:
    from services.catalog import service_kinds

    return list(service_kinds())


def _processes(ctx: click.Context, begun: str) -> list[str]:
    from pathlib import Path

    from deploy.instance_lock import running_fleets
    from deploy.run_folder import read_state

    port = ctx.params.get("port")
    states = [read_state(Path(each.folder)) for each in running_fleets() if port in (None, each.port)]
    return [process.name for state in states if state for process in state.processes]


def _sets(ctx: click.Context, begun: str) -> list[str]:
    def question(transport: Transport) -> Iterable[str]:
        return [each.set for each in _parameter_schemas(transport)]

    return _with_typed_slash(query_network(ctx, question), begun)


def _parameters(ctx: click.Context, begun: str) -> list[str]:
    wanted = "/" + str(ctx.params.get("set") or ctx.params.get("set_name") or "").removeprefix("/")

    def question(transport: Transport) -> Iterable[str]:
        return [one.name for each in _parameter_schemas(transport) if each.set == wanted for one in each.parameters]

    return query_network(ctx, question)


def _parameter_schemas(transport: Transport) -> Iterable[Any]:
    from messages.names import key
    from messages.requests import PARAMS_LIST
    from messages.std import Empty
    from services.runtime.requests import call

    return call(transport, PARAMS_LIST, key(PARAMS_LIST.name), Empty(), TIMEOUT_S).sets


def _with_typed_slash(names: Iterable[str], begun: str) -> list[str]:
    """Names as the person writes them, with or without the first slash."""
    return [each if not begun or begun.startswith("/") else each.removeprefix("/") for each in names]


TOPIC = CompletingParam("topic", _topics)
NODE = CompletingParam("node", _nodes)
SERVICE = CompletingParam("service", _services)
TYPE = CompletingParam("type", _types)
TYPE_OR_VALUES = CompletingParam("type or values", _type_or_values)
FIELD = CompletingParam("field", _fields)
FLEET = CompletingParam("fleet", _fleets)
KIND = CompletingParam("service", _kinds)
PROCESS = CompletingParam("process", _processes)
SET = CompletingParam("set", _sets)
PARAMETER = CompletingParam("parameter", _parameters)
"""A parameter of the set that the argument ``set`` (or ``set_name``) names."""
