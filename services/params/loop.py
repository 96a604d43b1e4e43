"""The loop of the parameter service: topics of the parameter sets, requests, and scheduled changes."""

from __future__ import annotations

from pathlib import Path

import msgspec

from messages.base import DECODE_ERRORS
from messages.names import BadName
from messages.names import key as checked_key
from messages.parameters import (
    Announcement,
    Assignment,
    ParameterDescription,
    ParameterSchema,
    ParameterValues,
    ScheduledChange,
    ScheduledChanges,
    SetParameters,
)
from messages.requests import (
    PARAMS_ANNOUNCE,
    PARAMS_GET,
    PARAMS_HISTORY,
    PARAMS_LIST,
    PARAMS_RESET,
    PARAMS_SET,
    PARAMS_UNDO,
    ROSPARAM_DELETE,
    ROSPARAM_GET,
    ROSPARAM_HAS,
    ROSPARAM_NAMES,
    ROSPARAM_SEARCH,
    ROSPARAM_SET,
)
from messages.std import Time
from messages.topics import DESCRIPTIONS, ROSPARAM_TREE, SCHEDULE, UPDATES
from services.params import FILE_TEXT, ParamsParameters, Scheduled
from services.params.parameter_tree import ParameterTreeServer, read_tree_file
from services.params.schedule import Schedule, read_progress, write_progress
from services.params.server import ParameterServer
from services.params.store import MEMORY, open_store
from services.runtime.context import Context
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import Entity, token_pattern
from services.runtime.node import Node
from services.runtime.parameters.tree import ParameterTree
from services.runtime.publisher import Publisher

MAX_CLOSING = 100
"""Maximum sets whose publishers wait to be closed; beyond that, the first is closed at once."""
_TICKS = 2


class SetPublishers:
    """The publishers of two latched topics for each parameter set.

    In lockstep, members get the numbers of the last messages at the end of the tick in which they were sent, and wait
    for them from the next tick on: a publisher closed before then would leave them waiting. Otherwise it is closed
    ``at_once``.
    """

    def __init__(self, node: Node, at_once: bool) -> None:
        self._node, self._close_at_once = node, at_once
        self._publishers: dict[str, tuple[Publisher[ParameterSchema], Publisher[ParameterValues]]] = {}
        self._closing: dict[str, int] = {}

    def publish(self, message: ParameterSchema | ParameterValues) -> None:
        """Publish a set's new schema or values."""
        self._closing.pop(message.set, None)
        if message.set not in self._publishers:
            self._publishers[message.set] = (
                self._node.advertise(DESCRIPTIONS, f"{message.set}/{DESCRIPTIONS.name.removeprefix('~')}"),
                self._node.advertise(UPDATES, f"{message.set}/{UPDATES.name.removeprefix('~')}"),
            )
        descriptions, updates = self._publishers[message.set]
        if isinstance(message, ParameterSchema):
            descriptions.publish(message)
        else:
            updates.publish(message)

    def close(self, name: str) -> None:
        """Close the publishers of a set."""
        if name not in self._publishers:
            return
        self._closing[name] = _TICKS
        if self._close_at_once:
            self._close(name)
        elif len(self._closing) > MAX_CLOSING:
            self._close(next(iter(self._closing)))

    def tick(self) -> None:
        """Close the publishers that are due: messages sent before the last tick have arrived."""
        for name, left in list(self._closing.items()):
            self._closing[name] = left - 1
            if left == 0:
                self._close(name)

    def _close(self, name: str) -> None:
        del self._closing[name]
        self._node.unregister(*self._publishers.pop(name))


CLOCK_PATIENCE_S = 20.0
"""Wall time [s] without a first clock before a warning: this service starts before the simulation."""
SET_TIMEOUT_NS = 10_000_000_000
"""Simulation time [ns] after which a scheduled change whose set is still missing causes a warning."""


def run(ctx: Context[ParamsParameters]) -> None:
    """Serve until the process is asked to end."""
    _check_schedule(ctx.params.schedule)
    initial = read_tree_file(ctx.params.rosparam_file)
    ctx.advertise(SCHEDULE)
    ctx.node.clock_patience_s = CLOCK_PATIENCE_S
    with open_store(ctx.params.file) as store:

        def live_nodes() -> set[str]:
            entities = map(Entity.parse, ctx.node.transport.tokens(token_pattern("node")))
            return {each.node for each in entities if each is not None}

        publishers = SetPublishers(ctx.node, at_once=not ctx.lockstep)
        server = ParameterServer(store, publishers.publish, ctx.log, lambda: ctx.now, live_nodes, publishers.close)
        if ctx.params.file in ("", MEMORY):
            ctx.log.info("no file was given: values are kept for this run only")
        server.announce(_own_announcement(ctx))
        ctx.serve(PARAMS_ANNOUNCE, server.announce)
        ctx.serve(PARAMS_LIST, server.list)
        ctx.serve(PARAMS_GET, server.get)
        ctx.serve(PARAMS_SET, server.set)
        ctx.serve(PARAMS_RESET, server.reset)
        ctx.serve(PARAMS_UNDO, server.undo)
        ctx.serve(PARAMS_HISTORY, server.history)
        tree = _serve_tree(ctx, initial)
        _run_schedule(ctx, server, publishers, tree)


def _serve_tree(ctx: Context[ParamsParameters], initial: ParameterTree) -> ParameterTreeServer:
    publisher = ctx.node.advertise(ROSPARAM_TREE)
    tree = ParameterTreeServer(publisher.publish, initial)
    ctx.serve(ROSPARAM_SET, tree.set)
    ctx.serve(ROSPARAM_GET, tree.get)
    ctx.serve(ROSPARAM_DELETE, tree.delete)
    ctx.serve(ROSPARAM_HAS, tree.has)
    ctx.serve(ROSPARAM_SEARCH, tree.search)
    ctx.serve(ROSPARAM_NAMES, tree.names)
    ctx.node.extensions.append(_TreePublication(tree))
    tree.publish_changes()
    return tree


class _TreePublication:
    """Publishes the tree once after all requests of a turn of the loop."""

    def __init__(self, tree: ParameterTreeServer) -> None:
        self._tree = tree

    def spin_once(self) -> None:
        """Publish what the requests of this turn have changed."""
        self._tree.publish_changes()


def _run_schedule(
    ctx: Context[ParamsParameters], server: ParameterServer, publishers: SetPublishers, tree: ParameterTreeServer
) -> None:
    schedule, warned = Schedule(ctx.params.schedule), False
    file = Path(ctx.params.schedule_file) if ctx.params.schedule_file else None
    progress: ScheduledChanges | None = None
    for tick in ctx.ticks():
        publishers.tick()
        tree.tick(tick.time, tick.reset)
        if progress is None:
            before = _read_progress(ctx, file) if file else ScheduledChanges()
            progress = before if before.epoch == tick.epoch else ScheduledChanges(epoch=tick.epoch)
            schedule.start(tuple(each.number for each in progress.changes))
        if tick.reset:
            server.new_run()
            schedule.start()
            warned, progress = False, ScheduledChanges(epoch=tick.epoch)
        due = schedule.pop_due(tick.time, server.announced_sets)
        for number, each in due.items():
            reason = _apply(ctx, server, each)
            made = ScheduledChange(number=number, made=not reason, time=Time.of(tick.time), reason=reason)
            progress = msgspec.structs.replace(progress, changes=(*progress.changes, made))
        if due:
            ctx.publish(SCHEDULE, progress)
            if file:
                _write_progress(ctx, file, progress)
        if not warned and (late := schedule.overdue(tick.time, SET_TIMEOUT_NS)):
            warned = True
            sets = ", ".join(sorted({each.set for each in late}))
            ctx.log.warn(f"changes are scheduled for {sets}, which no service has announced: is the name right?")


def _apply(ctx: Context[ParamsParameters], server: ParameterServer, due: Scheduled) -> str:
    """Apply a scheduled change; returns the reason if it was refused, else an empty text."""
    values = tuple(Assignment(name=name, value=value) for name, value in due.values.items())
    try:
        server.set(SetParameters(set=due.set, values=values, run=True, who=f"schedule at {due.at:g} s"))
    except EleaError as error:
        ctx.log.error(f"the change of {due.set} scheduled at {due.at:g} s was not made: {error}")
        return str(error)
    shown = ", ".join(f"{name} = {value!r}" for name, value in due.values.items())
    ctx.log.info(f"{due.set}: {shown}, as scheduled")
    return ""


def _read_progress(ctx: Context[ParamsParameters], file: Path) -> ScheduledChanges:
    try:
        return read_progress(file)
    except (OSError, *DECODE_ERRORS) as error:
        ctx.log.warn(f"{file} cannot be read, scheduled changes that are due are made again: {error}")
        return ScheduledChanges()


def _write_progress(ctx: Context[ParamsParameters], file: Path, progress: ScheduledChanges) -> None:
    try:
        write_progress(file, progress)
    except OSError as error:
        ctx.log.warn(f"a restart of this service would repeat its scheduled changes: {error}")


def _check_schedule(schedule: tuple[Scheduled, ...]) -> None:
    for each in schedule:
        try:
            checked_key(each.set)
        except BadName as error:
            raise BadInput(f"schedule at {each.at:g} s: the set needs its absolute name: {error}") from None
        if not each.values:
            raise BadInput(f"schedule at {each.at:g} s: no values are given for {each.set}")


def _own_announcement(ctx: Context[ParamsParameters]) -> Announcement:
    """Return the announcement of this service's own set, which shows where values are saved."""
    file = ParameterDescription(name="file", type="str", default="", live=False, text=FILE_TEXT)
    given = (Assignment(name="file", value=ctx.params.file),) if ctx.params.file else ()
    return Announcement(set=ctx.node_name, node=ctx.node_name, parameters=(file,), command_line=given)
