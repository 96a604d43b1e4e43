"""The loop of the parameter service: topics of each set, requests, and scheduled changes."""

from __future__ import annotations

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
)
from messages.std import Time
from messages.topics import DESCRIPTIONS, SCHEDULE, UPDATES
from services.params import ParamsParameters, Scheduled
from services.params.schedule import Schedule, run_id
from services.params.server import ParameterServer
from services.params.store import MEMORY, SaveError, Store, open_store
from services.runtime.context import Context
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import Entity, token_pattern
from services.runtime.node import Node
from services.runtime.publisher import Publisher

MAX_CLOSING = 100
"""Sets whose publications wait for their end; beyond, the first of them end at once."""
_TICKS = 2


class SetPublishers:
    """Two latched topics for each set.

    In lockstep, the numbers of the last messages are told at the end of the tick in which they were sent, and count
    from the next one on: a publication that ended before would never be heard to its end. Without lockstep it ends
    ``at_once``.
    """

    def __init__(self, node: Node, at_once: bool) -> None:
        self._node, self._close_at_once = node, at_once
        self._publishers: dict[str, tuple[Publisher[ParameterSchema], Publisher[ParameterValues]]] = {}
        self._closing: dict[str, int] = {}

    def publish(self, news: ParameterSchema | ParameterValues) -> None:
        """Publish what has changed of a set."""
        self._closing.pop(news.set, None)
        if news.set not in self._publishers:
            self._publishers[news.set] = (
                self._node.advertise(DESCRIPTIONS, f"{news.set}/{DESCRIPTIONS.name.removeprefix('~')}"),
                self._node.advertise(UPDATES, f"{news.set}/{UPDATES.name.removeprefix('~')}"),
            )
        descriptions, updates = self._publishers[news.set]
        if isinstance(news, ParameterSchema):
            descriptions.publish(news)
        else:
            updates.publish(news)

    def close(self, name: str) -> None:
        """Publish nothing of a set any more."""
        if name not in self._publishers:
            return
        self._closing[name] = _TICKS
        if self._close_at_once:
            self._close(name)
        elif len(self._closing) > MAX_CLOSING:
            self._close(next(iter(self._closing)))

    def tick(self) -> None:
        """A tick has begun: what was sent before the last one has been heard."""
        for name, left in list(self._closing.items()):
            self._closing[name] = left - 1
            if left == 0:
                self._close(name)

    def _close(self, name: str) -> None:
        del self._closing[name]
        self._node.unregister(*self._publishers.pop(name))


CLOCK_PATIENCE_S = 20.0
"""Wall time without a first clock before the log says so: this service starts before the simulation."""
SET_TIMEOUT_NS = 10_000_000_000
"""Simulation time that a scheduled change waits for its set before the log says so."""


def run(ctx: Context[ParamsParameters]) -> None:
    """Serve until the process is asked to end."""
    _check_schedule(ctx.params.schedule)
    ctx.advertise(SCHEDULE)
    ctx.node.clock_patience_s = CLOCK_PATIENCE_S
    with open_store(ctx.params.file) as store:

        def living() -> set[str]:
            entities = map(Entity.parse, ctx.node.transport.tokens(token_pattern("node")))
            return {each.node for each in entities if each is not None}

        publications = SetPublishers(ctx.node, at_once=not ctx.lockstep)
        server = ParameterServer(store, publications.publish, ctx.log, lambda: ctx.now, living, publications.close)
        if ctx.params.file in ("", MEMORY):
            ctx.log.info("what is set is kept for this run only: no file was given")
        server.announce(_own_announcement(ctx))
        ctx.serve(PARAMS_ANNOUNCE, server.announce)
        ctx.serve(PARAMS_LIST, server.list)
        ctx.serve(PARAMS_GET, server.get)
        ctx.serve(PARAMS_SET, server.set)
        ctx.serve(PARAMS_RESET, server.reset)
        ctx.serve(PARAMS_UNDO, server.undo)
        ctx.serve(PARAMS_HISTORY, server.history)
        _run_schedule(ctx, server, store, publications)


def _run_schedule(
    ctx: Context[ParamsParameters], server: ParameterServer, store: Store, publications: SetPublishers
) -> None:
    schedule, run, warned, first = Schedule(ctx.params.schedule), run_id(), False, True
    made: list[ScheduledChange] = []
    for tick in ctx.ticks():
        publications.tick()
        if first and run:
            schedule.start(store.load_schedule_position(run, tick.epoch))
        if tick.reset:
            server.new_run()
            schedule.start()
            warned, made = False, []
        first = False
        due = schedule.pop_due(tick.time, server.announced_sets)
        for number, each in due.items():
            reason = _apply(ctx, server, each)
            made.append(ScheduledChange(number=number, made=not reason, time=Time.of(tick.time), reason=reason))
        if due:
            ctx.publish(SCHEDULE, ScheduledChanges(epoch=tick.epoch, changes=tuple(made)))
        if run and (due or tick.reset):
            _save_schedule_position(ctx, store, run, tick.epoch, schedule.done)
        if not warned and (late := schedule.overdue(tick.time, SET_TIMEOUT_NS)):
            warned = True
            sets = ", ".join(sorted({each.set for each in late}))
            ctx.log.warn(f"changes are scheduled for {sets}, which no service has announced: is the name right?")


def _apply(ctx: Context[ParamsParameters], server: ParameterServer, due: Scheduled) -> str:
    """Make a change; why it was not made, empty when it was."""
    values = tuple(Assignment(name=name, value=value) for name, value in due.values.items())
    try:
        server.set(SetParameters(set=due.set, values=values, run=True, who=f"schedule at {due.at:g} s"))
    except EleaError as error:
        ctx.log.error(f"the change of {due.set} scheduled at {due.at:g} s was not made: {error}")
        return str(error)
    said = ", ".join(f"{name} = {value!r}" for name, value in due.values.items())
    ctx.log.info(f"{due.set}: {said}, as scheduled")
    return ""


def _save_schedule_position(
    ctx: Context[ParamsParameters], store: Store, run: str, epoch: int, done: frozenset[int]
) -> None:
    try:
        store.save_schedule_position(run, epoch, done)
    except SaveError as error:
        ctx.log.warn(f"after a restart of this service, its scheduled changes would come again: {error}")


def _check_schedule(schedule: tuple[Scheduled, ...]) -> None:
    for each in schedule:
        try:
            checked_key(each.set)
        except BadName as error:
            raise BadInput(f"schedule at {each.at:g} s: the set needs its absolute name: {error}") from None
        if not each.values:
            raise BadInput(f"schedule at {each.at:g} s: no values are given for {each.set}")


def _own_announcement(ctx: Context[ParamsParameters]) -> Announcement:
    """This service's own set: it shows where values are kept."""
    text = "SQLite file of what was set; empty or :memory: keeps it for this run"
    file = ParameterDescription(name="file", type="str", default="", live=False, text=text)
    given = (Assignment(name="file", value=ctx.params.file),) if ctx.params.file else ()
    return Announcement(set=ctx.node_name, node=ctx.node_name, parameters=(file,), command_line=given)
