"""Runs a fleet and reports on it: lock the port, supervise, grade."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import msgspec

from deploy import INTERRUPTED, VERSION
from deploy.fleet import Fleet
from deploy.instance_lock import check_parameter_file_unused, instance_lock
from deploy.parameter_sets import SavedParameterNotes, effective_parameters, fleet_values, overridden_parameter_note
from deploy.processes import MOST_DIRECT, ProcessSpec, choose_topology, plan_processes, write_containers
from deploy.progress import ProgressDisplay, ProgressReporter
from deploy.report.checks import service_checks, unknown_node_notes
from deploy.report.notes import fleet_notes, overrides_note, start_lines
from deploy.report.record import Check, EffectiveParameter, Report, RunFacts
from deploy.report.write import read_measurements, write_report
from deploy.rosparam import fleet_parameter_tree, write_parameter_tree
from deploy.run_folder import ROSPARAM_FILE
from deploy.service_parameters import RunOptions, fleet_endpoint, has_rosparam, listen_endpoints
from deploy.supervisor.log_file import last_line, log_name
from deploy.supervisor.node import RunMonitor, supervisor_node
from deploy.supervisor.reaper import Reaper
from deploy.supervisor.spawner import Spawner
from deploy.supervisor.supervisor import Outcome, Supervisor
from services.grader.records import MEASUREMENTS_FILE
from services.runtime.errors import BadInput
from services.runtime.fleet_instances import FleetInstance
from services.runtime.process import ROOT
from services.runtime.transport.zenoh_config import OPEN_TO_ALL, is_local
from services.sim.engines import default_engine


class RunResult(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a run; without measurements, ``report`` is None and ``error`` the reason."""

    outcome: Outcome
    report: Report | None
    error: str = ""

    def exit_status(self, fleet: Fleet) -> int:
        """Return the exit status of ``up``: 0 if all processes ended as they should and every check holds, else 1 or
        INTERRUPTED.

        A fleet that never ends on its own is expected to be interrupted, but not before its grader could begin.
        """
        early = self.report is None and not self.outcome.failed_on_stop
        if self.outcome.ended == "interrupted" and (early or fleet.run.ends != "never"):
            return INTERRUPTED
        well = self.outcome.ended != "failed" and not self.outcome.failed_on_stop
        return 0 if well and self.report is not None and self.report.ok else 1


def run_fleet(fleet: Fleet, options: RunOptions, screen: ProgressDisplay) -> RunResult:
    """Run a fleet to its end; raises BadInput if it cannot start: a port or file in use, a bad name."""
    started = datetime.now().astimezone().isoformat(timespec="seconds")
    entry = FleetInstance(
        fleet=fleet.name,
        mode=fleet.run.mode,
        port=fleet.run.port,
        pid=os.getpid(),
        folder=str(options.folder),
        started=started,
        domain=options.domain,
        router=fleet_endpoint(fleet),
        listen=listen_endpoints(fleet, options),
        root=str(ROOT),
        saved=str(options.saved or ""),
    )
    chosen_by_size, fleet = fleet.run.topology == "auto", choose_topology(fleet)
    plan = plan_processes(fleet, options)
    if has_rosparam(fleet):
        write_parameter_tree(fleet_parameter_tree(fleet), options.folder / ROSPARAM_FILE)
    write_containers(plan, options.folder)
    own = fleet_values(fleet, plan)
    with instance_lock(entry):
        if options.saved is not None:
            check_parameter_file_unused(options.saved)
        screen.print_line(f"{fleet.name}: {_size(plan)}, {fleet.run.mode}; results in {options.folder}")
        if chosen_by_size and fleet.run.topology == "star":
            screen.print_line(f"topology star (more than {MOST_DIRECT} nodes): all messages pass through the router")
        for each in entry.listen:
            who = "every user of this machine can read everything and drive the robots"
            screen.print_line(f"listening on {each}: {who if is_local(each) else OPEN_TO_ALL}")
        for each in start_lines(fleet, options.overrides):
            screen.print_line(each)
        reaper = Reaper()
        try:
            members = [name for each in plan for name in each.names]
            lockstep = fleet.run.mode == "lockstep"
            with supervisor_node(fleet_endpoint(fleet), options.domain, own, members, lockstep) as bus:
                spawner = Spawner(options.folder, reaper, show=screen.print_line)
                saved = SavedParameterNotes(bus.parameters, own)
                progress = ProgressReporter(
                    screen, options.folder, lambda: (*saved.new_lines(), *bus.run_monitor().new_problems(fleet.change))
                )
                supervisor = Supervisor(fleet.name, fleet.run.mode, plan, bus, spawner, progress, fleet.run.seed)
                outcome = asyncio.run(_supervise(supervisor, screen))
                bus.drain()
                reported, monitor, checks = dict(bus.parameters()), bus.run_monitor(), service_checks(bus.checks())
        finally:
            reaper.close()
        if outcome.ended != "graded":
            screen.print_line(f"the fleet ended: {outcome.reason}")
        for name in outcome.failed_on_stop:
            log = options.folder / "logs" / log_name(name)
            screen.print_line(f"{name} ended with an error: {last_line(log) or f'see {log}'}")
        found = (
            overrides_note(options.overrides)
            + fleet_notes(fleet)
            + overridden_parameter_note(reported, own, fleet)
            + unknown_node_notes(bus.unknown_nodes)
            + outcome.containers_lost
        )
        return _write_report(
            fleet, options, outcome, started, found, effective_parameters(reported, own), monitor, checks
        )


def _size(plan: Sequence[ProcessSpec]) -> str:
    """Return the number of processes, and of nodes if some share one."""
    nodes = sum(len(each.nodes) for each in plan)
    return f"{len(plan)} processes" + (f" with {nodes} nodes" if nodes > len(plan) else "")


async def _supervise(supervisor: Supervisor, screen: ProgressDisplay) -> Outcome:
    """Run the fleet; SIGINT, SIGTERM or SIGHUP stops it, a second one kills it."""

    def interrupt() -> None:
        screen.print_line("stopping; press Ctrl-C again to kill")
        supervisor.interrupt()

    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, interrupt)
    return await supervisor.run()


def _write_report(
    fleet: Fleet,
    options: RunOptions,
    outcome: Outcome,
    started: str,
    found: tuple[str, ...],
    parameters: dict[str, dict[str, EffectiveParameter]],
    monitor: RunMonitor,
    checks: tuple[Check, ...],
) -> RunResult:
    try:
        measured = read_measurements(options.folder)
        facts = RunFacts(
            fleet=fleet.name,
            mode=fleet.run.mode,
            seed=fleet.run.seed,
            version=VERSION,
            wall_seconds=outcome.wall_seconds,
            restarts=outcome.restarts,
            started=started,
            factor=fleet.run.factor,
            engine=fleet.run.engine or default_engine(),
            topology=fleet.run.topology,
            changes=monitor.change_figures(fleet.change, measured.sim_seconds),
            absent=monitor.absent_nodes,
            failed=outcome.failed_nodes,
            lag_s=monitor.lag_s,
            notes=found,
            parameters=parameters,
            checks=checks,
        )
        return RunResult(
            outcome=outcome, report=write_report(options.folder, facts, fleet.active_bounds(), options.picture)
        )
    except BadInput as error:
        return RunResult(outcome=outcome, report=None, error=reason_unmeasured(outcome, options.folder) or str(error))


def reason_unmeasured(outcome: Outcome, folder: Path) -> str:
    """Return why a run has no measurements although its grader did not fail; empty if the grader is the reason."""
    failed = outcome.failed_on_stop or outcome.reason.startswith("grader ")
    if failed or outcome.ended == "graded" or (folder / MEASUREMENTS_FILE).exists():
        return ""
    return "the fleet ended before its grader had written any measurements"
