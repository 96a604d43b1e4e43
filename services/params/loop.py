"""The loop of the parameter service: answer what is asked, and change at its time what is scheduled."""

from __future__ import annotations

from messages.names import BadName
from messages.names import key as checked_key
from messages.parameters import (
    Announcement,
    Assignment,
    ParameterDescription,
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
from messages.topics import SCHEDULE
from services.params import ParamsParameters, Scheduled
from services.params.desk import Desk
from services.params.publications import Publications
from services.params.schedule import Schedule, this_run
from services.params.store import MEMORY, NotSaved, Store, opened
from services.runtime.context import Context
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import Entity, pattern

PATIENCE_NS = 10_000_000_000
"""Simulation time that a scheduled change waits for its set before the log says so."""


def run(ctx: Context[ParamsParameters]) -> None:
    """Serve until the process is asked to end."""
    _check(ctx.params.schedule)
    with opened(ctx.params.file) as store:

        def living() -> set[str]:
            entities = map(Entity.parse, ctx.kernel.transport.tokens(pattern("node")))
            return {each.node for each in entities if each is not None}

        publications = Publications(ctx.kernel, at_once=not ctx.lockstep)
        desk = Desk(store, publications.tell, ctx.log, lambda: ctx.now, living, publications.end)
        if ctx.params.file in ("", MEMORY):
            ctx.log.info("what is set is kept for this run only: no file was given")
        desk.announce(_own(ctx))
        ctx.serve(PARAMS_ANNOUNCE, desk.announce)
        ctx.serve(PARAMS_LIST, desk.list)
        ctx.serve(PARAMS_GET, desk.get)
        ctx.serve(PARAMS_SET, desk.set)
        ctx.serve(PARAMS_RESET, desk.reset)
        ctx.serve(PARAMS_UNDO, desk.undo)
        ctx.serve(PARAMS_HISTORY, desk.history)
        _keep(ctx, desk, store, publications)


def _keep(ctx: Context[ParamsParameters], desk: Desk, store: Store, publications: Publications) -> None:
    schedule, run, warned, first = Schedule(ctx.params.schedule), this_run(), False, True
    made: list[ScheduledChange] = []
    for tick in ctx.ticks():
        publications.tick()
        if first and run:
            schedule.start(store.progress(run, tick.epoch))
        if tick.reset:
            desk.new_run()
            schedule.start()
            warned, made = False, []
        first = False
        due = schedule.due(tick.time, desk.present)
        for number, each in due.items():
            reason = _apply(ctx, desk, each)
            made.append(ScheduledChange(number=number, made=not reason, time=Time.of(tick.time), reason=reason))
        if due:
            ctx.publish(SCHEDULE, ScheduledChanges(epoch=tick.epoch, changes=tuple(made)))
        if run and (due or tick.reset):
            _proceed(ctx, store, run, tick.epoch, schedule.done)
        if not warned and (late := schedule.late(tick.time, PATIENCE_NS)):
            warned = True
            sets = ", ".join(sorted({each.set for each in late}))
            ctx.log.warn(f"changes are scheduled for {sets}, which no service has announced: is the name right?")


def _apply(ctx: Context[ParamsParameters], desk: Desk, due: Scheduled) -> str:
    """Make a change; why it was not made, empty when it was."""
    values = tuple(Assignment(name=name, value=value) for name, value in due.values.items())
    try:
        desk.set(SetParameters(set=due.set, values=values, run=True, who=f"schedule at {due.at:g} s"))
    except EleaError as error:
        ctx.log.error(f"the change of {due.set} scheduled at {due.at:g} s was not made: {error}")
        return str(error)
    said = ", ".join(f"{name} = {value!r}" for name, value in due.values.items())
    ctx.log.info(f"{due.set}: {said}, as scheduled")
    return ""


def _proceed(ctx: Context[ParamsParameters], store: Store, run: str, epoch: int, done: frozenset[int]) -> None:
    try:
        store.proceed(run, epoch, done)
    except NotSaved as error:
        ctx.log.warn(f"after a restart of this service, its scheduled changes would come again: {error}")


def _check(schedule: tuple[Scheduled, ...]) -> None:
    for each in schedule:
        try:
            checked_key(each.set)
        except BadName as error:
            raise BadInput(f"schedule at {each.at:g} s: the set needs its absolute name: {error}") from None
        if not each.values:
            raise BadInput(f"schedule at {each.at:g} s: no values are given for {each.set}")


def _own(ctx: Context[ParamsParameters]) -> Announcement:
    """This service's own set: it shows where values are kept."""
    text = "SQLite file of what was set; empty or :memory: keeps it for this run"
    file = ParameterDescription(name="file", type="str", default="", live=False, text=text)
    given = (Assignment(name="file", value=ctx.params.file),) if ctx.params.file else ()
    return Announcement(set=ctx.node, node=ctx.node, parameters=(file,), command_line=given)
