"""How a fleet of real processes ends: by its grader, by a required process, by force; with all grandchildren."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec
import psutil
import pytest

from deploy.processes import ProcessSpec
from deploy.supervisor import managed_process
from deploy.supervisor.managed_process import STOP_TIMEOUTS_S, ManagedProcess
from deploy.supervisor.supervisor import Outcome, Supervisor
from messages.elea import FleetState, Health
from services.runtime.process import ROOT
from tests.deploy.supervisor.supervisor_harness import (
    FAST_POLICY,
    WITHIN_S,
    SupervisorHarness,
    faulty_process,
    has_ended,
    play_side_by_side,
    wait_all_ready,
    wait_until,
)

LONG_ENOUGH_S = (WITHIN_S, WITHIN_S)
"""Wall time limits for a process that ends by itself after SIGINT, on a busy machine: it is not signalled again."""


async def run_to_end(harness: SupervisorHarness, *processes: ProcessSpec) -> tuple[str, str]:
    try:
        outcome = await asyncio.wait_for(harness.supervisor(*processes).run(), WITHIN_S)
        return outcome.ended, outcome.reason
    finally:
        harness.reaper.close()


async def grader_that_finishes_ends_the_run(harness: SupervisorHarness) -> None:
    ended, _ = await run_to_end(
        harness, faulty_process("good", "/a"), faulty_process("brief", "/g", "0.5", kind="grader", required=True)
    )
    assert ended == "graded"
    assert harness.states("g")[-1] == "finished"
    assert harness.states("a")[-1] == "stopped"


def test_wall_time_counts_from_when_simulation_time_can_begin(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    heartbeats, read, rested = harness.bus.heartbeats, list[float](), list[float]()

    def read_heartbeats() -> Sequence[Health]:
        if "ready" not in harness.states("begins"):
            read.append(time.monotonic())
        return heartbeats()

    async def rest(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        await asyncio.sleep(0.3)
        rested.append(time.monotonic())

    harness.bus.heartbeats = read_heartbeats  # type: ignore[method-assign]
    late = faulty_process("good", "/late", depends_on=("begins",))
    outcome = harness.run(rest, faulty_process("good", "/begins", awaited=True), late)
    assert read[-1] > harness.time_of("begins", "starting")
    longest = harness.time_of("late", "stopping") - read[-1]
    assert rested[0] - harness.time_of("begins", "ready") <= outcome.wall_seconds <= longest


async def required_process_that_fails_ends_the_fleet(harness: SupervisorHarness) -> None:
    crash = faulty_process("crash_later", "/r", "0.3", required=True, policy=FAST_POLICY)
    ended, reason = await run_to_end(harness, faulty_process("good", "/a"), crash)
    assert ended == "failed"
    assert reason.startswith("r failed: exit status 1; restarted 3 times")
    assert harness.states("a")[-1] == "stopped"


async def run_graded(harness: SupervisorHarness, process: ProcessSpec, stopped: str = "") -> Outcome:
    """Run a process until a grader ends the run, once all are ready; first stop the process ``stopped`` by request."""
    harness.stop_timeouts = LONG_ENOUGH_S
    grader = faulty_process("grader", "/g", required=True)
    supervisor = harness.supervisor(process, grader)
    running = asyncio.create_task(supervisor.run())
    try:
        await wait_all_ready(supervisor)
        if stopped:
            harness.bus.requests.append(("stop", stopped))
            await wait_until(lambda: supervisor.processes[stopped].state == "stopped")
        (harness.folder / "graded").touch()
        return await asyncio.wait_for(running, WITHIN_S)
    finally:
        harness.reaper.close()


async def its_node_has_ended(supervisor: Supervisor) -> None:
    """Wait until the only node of the process ``c`` has reported that it is stopping."""
    await wait_all_ready(supervisor)
    await wait_until(lambda: supervisor.processes["c"].activity == "stopping")


def test_a_process_that_is_about_to_crash_has_crashed_though_its_fleet_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Printing its traceback takes a while, within which a lockstep run may end."""
    monkeypatch.setattr(managed_process, "ENDING_S", WITHIN_S)
    harness = SupervisorHarness(tmp_path)
    changed = harness.on_state_change

    def crash_as_the_fleet_ends(process: ManagedProcess, fleet: FleetState) -> None:
        changed(process, fleet)
        if (process.spec.name, process.state) == ("a", "stopping"):
            (harness.folder / "end").touch()

    harness.on_state_change = crash_as_the_fleet_ends  # type: ignore[method-assign]
    outcome = harness.run(its_node_has_ended, faulty_process("end_slowly", "/c"), faulty_process("good", "/a"))
    assert outcome.failed_nodes == ("/c",)
    assert harness.states("c")[-1] == "failed"
    assert harness.states("a")[-1] == "stopped"


async def a_process_whose_node_has_ended_and_that_does_not_end_is_asked_to(harness: SupervisorHarness) -> None:
    outcome = await harness.play(its_node_has_ended, faulty_process("end_slowly", "/c"))
    assert outcome.failed_nodes == ()
    assert harness.states("c")[-2:] == ["stopping", "stopped"]


async def a_process_that_fails_as_a_graded_run_stops_it_has_failed(harness: SupervisorHarness) -> None:
    """It may have raised in the last step, and be printing its traceback."""
    outcome = await run_graded(harness, faulty_process("fail_on_stop", "/c"))
    assert (outcome.failed_on_stop, outcome.failed_nodes) == (("c",), ("/c",))


async def a_process_that_fails_on_a_stop_by_request_left_before_the_end(harness: SupervisorHarness) -> None:
    outcome = await run_graded(harness, faulty_process("fail_on_stop", "/c"), stopped="c")
    assert (outcome.failed_on_stop, outcome.failed_nodes) == (("c",), ())


async def a_container_that_fails_as_a_graded_run_stops_it_is_lost(harness: SupervisorHarness) -> None:
    single = faulty_process("fail_on_stop", "/c")
    outcome = await run_graded(harness, msgspec.structs.replace(single, nodes=2 * single.nodes))
    assert outcome.containers_lost == (
        "the process c of /c, /c has ended: exit status 1: RuntimeError: it fails at the end",
    )


async def a_program_of_ros_1_may_fail_when_it_is_stopped(harness: SupervisorHarness) -> None:
    outcome = await run_graded(
        harness, faulty_process("fail_on_stop", "/c", kind=str(ROOT / "tests/ros1/scripts/drive/pid_heading.py"))
    )
    assert (outcome.failed_on_stop, outcome.failed_nodes) == ((), ())


async def an_interrupted_run_judges_no_process_by_how_it_stops(harness: SupervisorHarness) -> None:
    harness.stop_timeouts = LONG_ENOUGH_S
    outcome = await harness.play(wait_all_ready, faulty_process("fail_on_stop", "/c"))
    assert (outcome.ended, outcome.failed_on_stop, outcome.failed_nodes) == ("interrupted", ("c",), ())


async def required_process_that_finishes_too_early_ends_the_fleet(harness: SupervisorHarness) -> None:
    ended, reason = await run_to_end(
        harness, faulty_process("good", "/a"), faulty_process("brief", "/r", "0.3", required=True)
    )
    assert (ended, reason) == ("failed", "r finished: exit status 0")


async def finished_service_is_not_restarted(harness: SupervisorHarness) -> None:
    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "finished")
        await asyncio.sleep(0.3)

    assert (await harness.play(watch, faulty_process("brief", "/a", "0.2"))).restarts == 0
    assert harness.states("a")[-1] == "finished"


def test_deaf_process_is_killed_in_turn(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path, stop_timeouts=(0.4, 0.3))
    harness.run(wait_all_ready, faulty_process("deaf", "/a"))
    assert 0.7 <= harness.time_of("a", "stopped") - harness.time_of("a", "stopping") < sum(STOP_TIMEOUTS_S)
    assert harness.bus.published[-1].processes[0].exit_status == -signal.SIGKILL


async def second_interrupt_kills_at_once(harness: SupervisorHarness) -> None:
    harness.stop_timeouts = (20.0, 20.0)

    async def twice(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        supervisor.interrupt()
        await wait_until(lambda: harness.states("a")[-1] == "stopping")
        supervisor.interrupt()

    await harness.play(twice, faulty_process("deaf", "/a"))
    assert harness.time_of("a", "stopped") - harness.time_of("a", "stopping") < harness.stop_timeouts[0]


async def error_of_the_supervisor_itself_ends_the_fleet_in_order(harness: SupervisorHarness) -> None:
    beats = harness.bus.heartbeats

    def fail_once_ready() -> Sequence[Health]:
        if harness.states("a")[-1:] == ["ready"]:
            raise RuntimeError("the bus broke")
        return beats()

    harness.bus.heartbeats = fail_once_ready  # type: ignore[method-assign]
    ended, reason = await run_to_end(harness, faulty_process("good", "/a"))
    assert (ended, reason) == ("failed", "internal error of the supervisor (watch): RuntimeError: the bus broke")
    assert harness.states("a")[-1] == "stopped"


async def grandchild_goes_with_its_group(harness: SupervisorHarness) -> None:
    pids = []

    async def watch(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        pids.append(int((harness.folder / "grandchild").read_text()))
        assert not has_ended(pids[0])

    await harness.play(watch, faulty_process("parent", "/a"))
    await wait_until(lambda: has_ended(pids[0]))


async def grandchild_of_a_process_that_crashed_goes_before_the_restart(harness: SupervisorHarness) -> None:
    async def watch(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        first = int((harness.folder / "grandchild").read_text())
        psutil.Process(supervisor.processes["a"].state_message().pid).kill()
        await wait_until(lambda: harness.states("a").count("ready") == 2)
        await wait_until(lambda: has_ended(first))

    await harness.play(watch, faulty_process("parent", "/a"))


def test_ends(tmp_path: Path) -> None:
    play_side_by_side(
        tmp_path,
        (
            grader_that_finishes_ends_the_run,
            required_process_that_fails_ends_the_fleet,
            a_process_whose_node_has_ended_and_that_does_not_end_is_asked_to,
            a_process_that_fails_as_a_graded_run_stops_it_has_failed,
            a_process_that_fails_on_a_stop_by_request_left_before_the_end,
            a_container_that_fails_as_a_graded_run_stops_it_is_lost,
            a_program_of_ros_1_may_fail_when_it_is_stopped,
            an_interrupted_run_judges_no_process_by_how_it_stops,
            required_process_that_finishes_too_early_ends_the_fleet,
            finished_service_is_not_restarted,
            second_interrupt_kills_at_once,
            error_of_the_supervisor_itself_ends_the_fleet_in_order,
            grandchild_goes_with_its_group,
            grandchild_of_a_process_that_crashed_goes_before_the_restart,
        ),
    )
