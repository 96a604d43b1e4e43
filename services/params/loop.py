"""The loop of the parameter service: answer what is asked, and change at its time what is scheduled."""

from __future__ import annotations

from messages.names import BadName
from messages.names import key as checked_key
from messages.parameters import (
    Announcement,
    Assignment,
    ParameterDescription,
    ParameterSchema,
    ParameterValues,
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
from messages.topics import DESCRIPTIONS, UPDATES
from services.params import ParamsParameters, Scheduled
from services.params.desk import Desk
from services.params.schedule import Schedule
from services.params.store import MEMORY, opened
from services.runtime.context import Context
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import pattern

PATIENCE_NS = 10_000_000_000
"""Simulation time that a scheduled change waits for its set before the log says so."""


def run(ctx: Context[ParamsParameters]) -> None:
    """Serve until the process is asked to end."""
    _check(ctx.params.schedule)
    with opened(ctx.params.file) as store:

        def tell(news: ParameterSchema | ParameterValues) -> None:
            if isinstance(news, ParameterSchema):
                ctx.publish(DESCRIPTIONS, news, f"{news.set}/parameter_descriptions")
            else:
                ctx.publish(UPDATES, news, f"{news.set}/parameter_updates")

        def alive(node: str) -> bool:
            return bool(ctx.kernel.transport.tokens(pattern("node", node)))

        desk = Desk(store, tell, ctx.log, lambda: ctx.now, alive)
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
        _keep(ctx, desk)


def _keep(ctx: Context[ParamsParameters], desk: Desk) -> None:
    schedule, warned = Schedule(ctx.params.schedule), False
    for tick in ctx.ticks():
        if tick.reset:
            desk.new_run()
            schedule.start()
            warned = False
        for each in schedule.due(tick.time, desk.present):
            _apply(ctx, desk, each)
        if not warned and (late := schedule.late(tick.time, PATIENCE_NS)):
            warned = True
            sets = ", ".join(sorted({each.set for each in late}))
            ctx.log.warn(f"changes are scheduled for {sets}, which no service has announced: is the name right?")


def _apply(ctx: Context[ParamsParameters], desk: Desk, due: Scheduled) -> None:
    values = tuple(Assignment(name=name, value=value) for name, value in due.values.items())
    try:
        desk.set(SetParameters(set=due.set, values=values, run=True, who=f"schedule at {due.at:g} s"))
    except EleaError as error:
        ctx.log.error(f"the change of {due.set} scheduled at {due.at:g} s was not made: {error}")


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
