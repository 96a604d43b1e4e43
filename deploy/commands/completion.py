"""Shell completion: the names that click's ``shell_complete`` offers, live ones from the network within 300 ms.

Click itself completes commands, options, choices and files. Its script for bash runs the command as typed; those for
zsh and fish search the PATH for ``elea``, so here they run the ``./elea`` of this project.
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
    from services.runtime.graph import Entity, Kind
    from services.runtime.transport.api import Transport

TIMEOUT_S = 0.3
"""Wall time for the network to answer, so that a hanging router does not block the shell."""

_PROGRAM = shlex.quote(str(ROOT / "elea")).replace("%", "%%")
_IN_PATH = "    (( ! $+commands[%(prog_name)s] )) && return 1\n"


class ProjectZshComplete(ZshComplete):
    """Click's script for zsh, running this project's ``./elea``."""

    source_template = ZshComplete.source_template.replace(_IN_PATH, "").replace(
        "_complete %(prog_name)s", f"_complete {_PROGRAM}"
    )


class ProjectFishComplete(FishComplete):
    """Click's script for fish, running this project's ``./elea``."""

    source_template = FishComplete.source_template.replace(
        "(commandline -t) %(prog_name)s", f"(commandline -t) {_PROGRAM}"
    )


def register_shells() -> None:
    """Replace click's scripts for zsh and fish."""
    add_completion_class(ProjectZshComplete)
    add_completion_class(ProjectFishComplete)


Source = Callable[[click.Context, str], Iterable[str]]
"""Returns candidates for the word being typed, from the words before it and its beginning."""
Question = Callable[["Transport", click.Context], Iterable[str]]
"""Returns candidates from the network."""


class CompletingParam(click.ParamType[str]):
    """A parameter without checks, completed from a source; from ``files`` if the source has no candidates."""

    def __init__(self, name: str, source: Source, files: bool = False) -> None:
        self.name, self._source, self._files = name, source, files

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem[Any]]:
        """Return the candidates that begin with ``incomplete``; none if the source fails."""
        try:
            found = sorted(set(self._source(ctx, incomplete)))
        except EleaError:
            return []
        fitting = [CompletionItem(each) for each in found if each.startswith(incomplete)]
        return fitting or ([CompletionItem(incomplete, type="file")] if self._files else [])


def live(question: Question) -> Source:
    """Return a source that queries the network; names have no leading slash if the typed word has none."""

    def source(ctx: click.Context, begun: str) -> list[str]:
        names = query_network(ctx, question)
        return [each if not begun or begun.startswith("/") else each.removeprefix("/") for each in names]

    return source


def query_network(ctx: click.Context, question: Question) -> list[str]:
    """Query the network that the command line names; return nothing if it does not answer within TIMEOUT_S."""
    answer: list[str] = []

    def ask() -> None:
        from services.runtime.light_node import open_transport
        from services.runtime.network_address import resolve_address

        try:
            address = resolve_address(
                ctx.params.get("connect") or "", ctx.params.get("domain") or "", _chosen_port(ctx)
            )
            with open_transport(address.router, address.domain, TIMEOUT_S) as transport:
                answer.extend(question(transport, ctx))
        except EleaError:
            return

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(TIMEOUT_S)
    return list(answer)


def _chosen_port(ctx: click.Context) -> int | None:
    """Return the port that ``--port`` or ``--fleet`` selects so far; raises BadInput."""
    from services.runtime.network_address import port_of_fleet

    port, fleet = ctx.params.get("port"), ctx.params.get("fleet")
    return port_of_fleet(fleet, port) if fleet else port


def _running_fleets(_: click.Context, begun: str) -> Iterable[str]:
    from services.runtime.fleet_instances import running_fleets

    return [each.fleet for each in running_fleets()]


def _topics(transport: Transport, _: click.Context) -> Iterable[str]:
    from deploy.live.topics import group_by_topic
    from services.runtime.graph import snapshot

    return group_by_topic(snapshot(transport))


def _nodes(transport: Transport, _: click.Context) -> Iterable[str]:
    return [each.node for each in _entities(transport, "node")]


def _services(transport: Transport, _: click.Context) -> Iterable[str]:
    return [each.name for each in _entities(transport, "srv")]


def _entities(transport: Transport, kind: Kind) -> list[Entity]:
    """Return the entities of one kind, without those of hidden nodes."""
    from services.runtime.graph import Entity, token_pattern

    found = (Entity.parse(each) for each in transport.tokens(token_pattern(kind), TIMEOUT_S))
    return [each for each in found if each and not each.node.rpartition("/")[2].startswith("_")]


def _sets(transport: Transport, _: click.Context) -> Iterable[str]:
    return [each.set for each in _parameter_schemas(transport)]


def _parameters(transport: Transport, ctx: click.Context) -> Iterable[str]:
    """Return the parameters of the set in the argument ``set`` or ``set_name``."""
    wanted = "/" + str(ctx.params.get("set") or ctx.params.get("set_name") or "").removeprefix("/")
    return [one.name for each in _parameter_schemas(transport) if each.set == wanted for one in each.parameters]


def _parameter_schemas(transport: Transport) -> Iterable[Any]:
    from messages.names import key
    from messages.requests import PARAMS_LIST
    from messages.std import Empty
    from services.runtime.requests import call

    return call(transport, PARAMS_LIST, key(PARAMS_LIST.name), Empty(), TIMEOUT_S).sets


def _types(_: click.Context, begun: str) -> Iterable[str]:
    from messages.records import RECORDS

    return RECORDS if "/msg/" not in begun else ["/msg/".join(each.split("/")) for each in RECORDS]


def _type_or_values(ctx: click.Context, begun: str) -> Iterable[str]:
    return [] if ctx.params.get("values") else _types(ctx, begun)


def _fields(ctx: click.Context, begun: str) -> Iterable[str]:
    from deploy.interfaces import known_topic
    from deploy.live.topics import absolute_name
    from services.runtime.field_path import complete_path

    # While an option's value is being typed, click does not name the arguments.
    topic = known_topic(absolute_name(ctx.params.get("topic") or next(iter(ctx.args), "")))
    return [] if topic is None else complete_path(topic.record, begun)


def _fleets(_: click.Context, begun: str) -> Iterable[str]:
    from deploy.fleet_file import fleet_names

    return fleet_names()


def _kinds(_: click.Context, begun: str) -> Iterable[str]:
    from services.catalog import service_kinds

    return (*service_kinds(), "container")


def _processes(ctx: click.Context, begun: str) -> Iterable[str]:
    from pathlib import Path

    from deploy.run_folder import read_state
    from services.runtime.fleet_instances import running_fleets

    port = _chosen_port(ctx)
    states = [read_state(Path(each.folder)) for each in running_fleets() if port in (None, each.port)]
    processes = [process for state in states if state for process in state.processes]
    return [*(each.name for each in processes), *(node[1:] for each in processes for node in each.nodes)]


TOPIC = CompletingParam("topic", live(_topics))
NODE = CompletingParam("node", live(_nodes))
SERVICE = CompletingParam("service", live(_services))
SET = CompletingParam("set", live(_sets))
PARAMETER = CompletingParam("parameter", live(_parameters))
TYPE = CompletingParam("type", _types)
TYPE_OR_VALUES = CompletingParam("type or values", _type_or_values)
FIELD = CompletingParam("field", _fields)
FLEET = CompletingParam("fleet", _fleets, files=True)
KIND = CompletingParam("service", _kinds, files=True)
PROCESS = CompletingParam("process", _processes)
RUNNING_FLEET = CompletingParam("name", _running_fleets)
