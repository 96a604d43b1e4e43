"""The supervisor with real processes: order, restarts, hangs, orders, and how a fleet ends."""

from __future__ import annotations

import asyncio
import signal
import time
from pathlib import Path

import msgspec
import psutil

from deploy.process import Process
from deploy.supervisor.pulse import LIMIT_S
from deploy.supervisor.supervisor import Supervisor
from tests.deploy.harness import FAST, Stage, child, gone, until


async def all_ready(supervisor: Supervisor) -> None:
    await until(lambda: all(life.state == "ready" for life in supervisor.lives.values()))


def test_starts_in_order_of_readiness_and_stops_in_reverse(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    first, second = child("good", "/first"), child("good", "/second", depends_on=("first",))
    third = child("good", "/third", depends_on=("first", "second"))
    outcome = stage.run(all_ready, third, second, first)
    order = [(name, state) for _, name, state in stage.seen if state in ("starting", "ready", "stopped")]
    assert order == [
        *[(name, state) for name in ("first", "second", "third") for state in ("starting", "ready")],
        *[(name, "stopped") for name in ("third", "second", "first")],
    ]
    assert outcome.ended == "interrupted"
    assert outcome.restarts == 0


def test_publishes_its_state_with_each_change(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    stage.run(all_ready, child("good", "/a"))
    told = [state.processes[0].state for state in stage.bus.published]
    assert told == stage.states("a") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert stage.bus.published[2].processes[0].pid > 0
    assert stage.bus.published[-1].processes[0].pid == 0


def test_killed_process_is_ready_again_soon(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def kill_one(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        killed = supervisor.lives["a"].show().pid
        psutil.Process(killed).kill()
        await until(lambda: supervisor.lives["a"].state == "backing off")
        await all_ready(supervisor)
        assert supervisor.lives["a"].show().pid != killed

    outcome = stage.run(kill_one, child("good", "/a"), child("good", "/b"))
    assert stage.states("a")[2:6] == ["ready", "backing off", "waiting", "starting"]
    assert outcome.restarts == 1
    assert stage.states("b") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert "killed by signal 9" in stage.log("a")


def test_hanging_loop_is_killed_after_three_missed_beats(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def watch(supervisor: Supervisor) -> None:
        await until(lambda: stage.states("a").count("ready") == 2)

    stage.run(watch, child("hang_after_start", "/a"))
    silence = stage.when("a", "backing off") - stage.when("a", "ready")
    assert LIMIT_S - 0.2 < silence < LIMIT_S + 1.0
    assert "no heartbeat for 3." in stage.log("a")


def test_stopped_process_counts_as_hanging(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def freeze(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        psutil.Process(supervisor.lives["a"].show().pid).suspend()
        await until(lambda: stage.states("a").count("ready") == 2)

    assert stage.run(freeze, child("good", "/a")).restarts == 1


def test_process_that_never_beats_is_given_up_after_its_grace(tmp_path: Path) -> None:
    stage = Stage(tmp_path, grace=0.3)

    async def watch(supervisor: Supervisor) -> None:
        await until(lambda: supervisor.lives["a"].state == "failed")

    stage.run(watch, child("silent", "/a", policy=FAST))
    assert "ready" not in stage.states("a")
    assert "no heartbeat" in stage.log("a")


def test_beats_of_another_life_do_not_count(tmp_path: Path) -> None:
    stage = Stage(tmp_path, grace=1.0)
    (tmp_path / "beats").write_text('{"node": "/a", "pid": 1}\n')

    async def watch(supervisor: Supervisor) -> None:
        await until(lambda: supervisor.lives["a"].state == "backing off")

    stage.run(watch, child("silent", "/a"))
    assert "ready" not in stage.states("a")


def test_silence_is_excused_while_what_carries_the_beats_is_down(tmp_path: Path) -> None:
    """A router that hangs silences everybody, and comes back some time before they are heard again."""
    stage = Stage(tmp_path)

    async def silence(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        stage.bus.mute = {"/router", "/a"}
        await until(lambda: stage.states("router").count("starting") == 2)
        stage.bus.mute = {"/a"}
        await until(lambda: supervisor.lives["router"].state == "ready")
        await asyncio.sleep(1.0)
        stage.bus.mute = set()
        await asyncio.sleep(LIMIT_S)

    outcome = stage.run(silence, child("good", "/router"), child("good", "/a", depends_on=("router",)))
    assert stage.states("a") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert outcome.restarts == 1


def test_crash_loop_fails_and_leaves_the_others_alone(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def watch(supervisor: Supervisor) -> None:
        await until(lambda: supervisor.lives["a"].state == "failed")
        assert supervisor.lives["b"].state == "ready"

    outcome = stage.run(watch, child("crash_at_once", "/a", policy=FAST), child("good", "/b"))
    assert stage.states("a").count("starting") == 1 + FAST.limit
    assert outcome.restarts == FAST.limit
    assert outcome.ended == "interrupted"
    shown = next(each for each in stage.bus.published[-1].processes if each.name == "a")
    assert (shown.state, shown.exit_status) == ("failed", 1)
    assert "restarted 3 times" in shown.reason
    assert "bad config" in stage.log("a")


def test_program_that_does_not_exist_fails(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    missing = child("good", "/a", policy=FAST, required=True)

    async def wait(supervisor: Supervisor) -> None:
        await until(lambda: supervisor.lives["a"].state == "failed")

    outcome = stage.run(wait, msgspec.structs.replace(missing, argv=("/nowhere/program",)))
    assert outcome.ended == "failed"
    assert "cannot start /nowhere/program" in stage.log("a")


def run_to_end(stage: Stage, *processes: Process) -> tuple[str, str]:
    async def run() -> tuple[str, str]:
        supervisor = stage.supervisor(*processes)
        outcome = await asyncio.wait_for(supervisor.run(), 30)
        return outcome.ended, outcome.reason

    try:
        return asyncio.run(run())
    finally:
        stage.warden.close()


def test_grader_that_finishes_ends_the_run(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    ended, _ = run_to_end(stage, child("good", "/a"), child("brief", "/g", "0.5", kind="grader", required=True))
    assert ended == "graded"
    assert stage.states("g")[-1] == "finished"
    assert stage.states("a")[-1] == "stopped"


def test_wall_time_counts_from_when_simulation_time_can_begin(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def rest(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        await asyncio.sleep(0.3)

    late = child("good", "/late", depends_on=("begins",))
    outcome = stage.run(rest, child("good", "/begins", begins=True), late)
    interrupted = stage.when("late", "stopping")
    assert abs(interrupted - stage.when("begins", "ready") - outcome.wall_seconds) < 0.1


def test_required_process_that_fails_ends_the_fleet(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    crash = child("crash_later", "/r", "0.3", required=True, policy=FAST)
    ended, reason = run_to_end(stage, child("good", "/a"), crash)
    assert ended == "failed"
    assert reason.startswith("r failed: exit status 1; restarted 3 times")
    assert stage.states("a")[-1] == "stopped"


def test_required_process_that_finishes_too_early_ends_the_fleet(tmp_path: Path) -> None:
    ended, reason = run_to_end(Stage(tmp_path), child("good", "/a"), child("brief", "/r", "0.3", required=True))
    assert (ended, reason) == ("failed", "r finished: exit status 0")


def test_finished_service_is_not_restarted(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def watch(supervisor: Supervisor) -> None:
        await until(lambda: supervisor.lives["a"].state == "finished")
        await asyncio.sleep(0.3)

    assert stage.run(watch, child("brief", "/a", "0.2")).restarts == 0
    assert stage.states("a")[-1] == "finished"


def test_deaf_process_is_killed_in_turn(tmp_path: Path) -> None:
    stage = Stage(tmp_path, patience=(0.4, 0.3))
    stage.run(all_ready, child("deaf", "/a"))
    assert 0.7 <= stage.when("a", "stopped") - stage.when("a", "stopping") < 2.0
    assert stage.bus.published[-1].processes[0].exit_status == -signal.SIGKILL


def test_second_interrupt_kills_at_once(tmp_path: Path) -> None:
    stage = Stage(tmp_path, patience=(20.0, 20.0))

    async def twice(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        supervisor.interrupt()
        await until(lambda: stage.states("a")[-1] == "stopping")
        supervisor.interrupt()

    started = time.monotonic()
    stage.run(twice, child("deaf", "/a"))
    assert time.monotonic() - started < 15


def test_grandchild_goes_with_its_group(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    pids = []

    async def watch(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        pids.append(int((tmp_path / "grandchild").read_text()))
        assert not gone(pids[0])

    stage.run(watch, child("parent", "/a"))
    assert gone(pids[0])


def test_grandchild_of_a_process_that_crashed_goes_before_the_restart(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def watch(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        first = int((tmp_path / "grandchild").read_text())
        psutil.Process(supervisor.lives["a"].show().pid).kill()
        await until(lambda: stage.states("a").count("ready") == 2)
        assert gone(first)

    stage.run(watch, child("parent", "/a"))


def test_orders(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    answers = stage.bus.answers

    async def order(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        life = supervisor.lives["tb3_0/a"]
        first = life.show().pid
        stage.bus.orders += [("start", "/tb3_0/a"), ("restart", "tb3_0/a"), ("restart", "tb3_0/aa")]
        await until(lambda: len(answers) == 3 and life.state == "ready" and life.show().pid != first)
        stage.bus.orders.append(("stop", "tb3_0/a"))
        await until(lambda: life.state == "stopped")
        stage.bus.orders += [("stop", "tb3_0/a"), ("start", "tb3_0/a")]
        await until(lambda: life.state == "ready")

    outcome = stage.run(order, child("good", "/tb3_0/a"))
    assert answers == [
        "refused: /tb3_0/a runs already (ready)",
        "tb3_0/a restarts",
        "refused: unknown process 'tb3_0/aa'; did you mean 'tb3_0/a'? (known: tb3_0/a)",
        "tb3_0/a stops",
        "refused: tb3_0/a does not run (stopped)",
        "tb3_0/a starts",
    ]
    assert outcome.restarts == 0


def test_log_is_bounded_and_never_blocks_its_process(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    lines = 100_000
    stage.run(all_ready, child("talker", "/a", str(lines)))
    logs = [tmp_path / "logs" / name for name in ("a.log", "a.log.1")]
    sizes = [each.stat().st_size for each in logs]
    assert sum(sizes) >= lines * 100
    assert max(sizes) <= 8 << 20
