"""A run from its fleet to its report: claim the port, supervise, grade."""

from __future__ import annotations

import asyncio
import os
import signal
from datetime import datetime
from pathlib import Path

import msgspec

from deploy.claim import Running, claim
from deploy.effective import Saved, effective, note
from deploy.fleet import Fleet
from deploy.parameter_file import check_unused
from deploy.parameter_sets import own_values
from deploy.process import processes
from deploy.progress import Progress, Screen
from deploy.report.notes import notes
from deploy.report.own_checks import own_checks, unheard
from deploy.report.record import Check, Effective, Report, RunFacts
from deploy.report.write import read_measurements, write_report
from deploy.supervisor.child import Nursery
from deploy.supervisor.conduct import Conduct
from deploy.supervisor.log_file import log_name
from deploy.supervisor.node_bus import node_bus
from deploy.supervisor.supervisor import Outcome, Supervisor
from deploy.supervisor.warden import Warden
from deploy.version import VERSION
from deploy.wiring import Terms, endpoint, open_endpoints
from services.runtime.errors import BadInput
from services.runtime.network.zenoh_config import OPEN_TO_ALL, is_local
from services.runtime.process import ROOT

INTERRUPTED = 130
"""Exit status of a run that was ended by Ctrl-C or ``down`` before its own end, as shells use it."""


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """What came of a run; ``report`` is None when nothing was measured, ``trouble`` then says why."""

    outcome: Outcome
    report: Report | None
    trouble: str = ""

    def status(self, fleet: Fleet) -> int:
        """The exit status of ``up``: 0 when all processes ended as they should and every check holds, else 1 or
        INTERRUPTED.

        A fleet that never ends by itself is meant to be interrupted.
        """
        if self.outcome.ended == "interrupted" and fleet.run.ends != "never":
            return INTERRUPTED
        well = self.outcome.ended != "failed" and not self.outcome.complaints
        return 0 if well and self.report is not None and self.report.ok else 1


def run_fleet(fleet: Fleet, terms: Terms, screen: Screen) -> Result:
    """Run a fleet to its end; raises BadInput when it cannot begin: a taken port or file, a bad name."""
    started = datetime.now().astimezone().isoformat(timespec="seconds")
    entry = Running(
        fleet=fleet.name,
        mode=fleet.run.mode,
        port=fleet.run.port,
        pid=os.getpid(),
        folder=str(terms.folder),
        started=started,
        domain=terms.domain,
        router=endpoint(fleet),
        listen=open_endpoints(fleet, terms),
        root=str(ROOT),
        saved=str(terms.saved or ""),
    )
    plan = processes(fleet, terms)
    own = own_values(fleet, plan)
    with claim(entry):
        if terms.saved is not None:
            check_unused(terms.saved)
        screen.say(f"{fleet.name}: {len(plan)} processes, {fleet.run.mode}; results go to {terms.folder}")
        for each in entry.listen:
            who = "every user of this machine can read everything and drive the robots"
            screen.say(f"listening on {each}: {who if is_local(each) else OPEN_TO_ALL}")
        warden = Warden()
        try:
            members = [each.node for each in plan]
            with node_bus(endpoint(fleet), terms.domain, own, members) as bus:
                nursery = Nursery(terms.folder, warden)
                saved = Saved(bus.parameters, own)
                progress = Progress(screen, terms.folder, lambda: (*saved.news(), *bus.conduct().news(fleet.change)))
                supervisor = Supervisor(fleet.name, fleet.run.mode, plan, bus, nursery, progress, fleet.run.seed)
                outcome = asyncio.run(_until_end(supervisor, screen))
                bus.hear_out()
                told, conduct, checks = dict(bus.parameters()), bus.conduct(), own_checks(bus.checks())
        finally:
            warden.close()
        if outcome.ended != "graded":
            screen.say(f"the fleet ended: {outcome.reason}")
        for name in outcome.complaints:
            screen.say(f"{name} ended with an error: {_last_line(terms.folder / 'logs' / log_name(name))}")
        found = notes(fleet) + note(told, own, fleet) + unheard(bus.strangers)
        return _graded(fleet, terms.folder, outcome, started, found, effective(told, own), conduct, checks)


async def _until_end(supervisor: Supervisor, screen: Screen) -> Outcome:
    """Run; SIGINT, SIGTERM and SIGHUP end the fleet, a second one at once."""

    def interrupt() -> None:
        screen.say("stopping; once more to kill")
        supervisor.interrupt()

    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, interrupt)
    return await supervisor.run()


def _last_line(log: Path) -> str:
    """What a process said last, else where to look."""
    try:
        lines = log.read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    return lines[-1] if lines else f"see {log}"


def _graded(
    fleet: Fleet,
    folder: Path,
    outcome: Outcome,
    started: str,
    found: tuple[str, ...],
    parameters: dict[str, dict[str, Effective]],
    conduct: Conduct,
    checks: tuple[Check, ...],
) -> Result:
    try:
        measured = read_measurements(folder)
        facts = RunFacts(
            fleet=fleet.name,
            mode=fleet.run.mode,
            seed=fleet.run.seed,
            version=VERSION,
            wall_seconds=outcome.wall_seconds,
            restarts=outcome.restarts,
            started=started,
            factor=fleet.run.factor,
            changes=conduct.changes(fleet.change, measured.sim_seconds),
            absent=conduct.absent,
            lag_s=conduct.lag_s,
            notes=found,
            parameters=parameters,
            checks=checks,
        )
        return Result(outcome=outcome, report=write_report(folder, facts, fleet.judged_by()))
    except BadInput as error:
        return Result(outcome=outcome, report=None, trouble=str(error))
