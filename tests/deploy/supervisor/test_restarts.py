"""What the supervisor restarts, how soon, and when it gives up: crashes, hangs and crash loops."""

from __future__ import annotations

import time
from asyncio import sleep
from pathlib import Path

import msgspec
import psutil

from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S, RECOVERY_S
from deploy.supervisor.supervisor import LATE_HEARTBEAT_S, Supervisor
from tests.deploy.supervisor.supervisor_harness import (
    FAST_POLICY,
    SupervisorHarness,
    faulty_process,
    play_side_by_side,
    wait_all_ready,
    wait_until,
)


async def killed_process_is_ready_again_soon(harness: SupervisorHarness) -> None:
    async def kill_one(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        killed = supervisor.processes["a"].state_message().pid
        psutil.Process(killed).kill()
        await wait_until(lambda: supervisor.processes["a"].state == "backing off")
        await wait_all_ready(supervisor)
        assert supervisor.processes["a"].state_message().pid != killed

    outcome = await harness.play(kill_one, faulty_process("good", "/a"), faulty_process("good", "/b"))
    assert harness.states("a")[2:6] == ["ready", "backing off", "waiting", "starting"]
    assert outcome.restarts == 1
    assert harness.states("b") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert "killed by signal 9" in harness.log("a")


async def hanging_loop(harness: SupervisorHarness) -> None:
    """It is killed after three missed beats."""

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: harness.states("a").count("ready") == 2)

    await harness.play(watch, faulty_process("hang_after_start", "/a"))
    assert harness.silence("a") > HEARTBEAT_TIMEOUT_S - 0.2
    assert harness.unexcused_silence("a") < HEARTBEAT_TIMEOUT_S + 1.0


async def endless_loop(harness: SupervisorHarness) -> None:
    """An endless loop isn't mistaken for waiting for a processor."""

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: harness.states("a").count("ready") == 2)

    await harness.play(watch, faulty_process("spin", "/a"))
    assert harness.unexcused_silence("a") < HEARTBEAT_TIMEOUT_S + 1.0


async def stopped_process(harness: SupervisorHarness) -> None:
    """A stopped process counts as hung."""

    async def freeze(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        psutil.Process(supervisor.processes["a"].state_message().pid).suspend()
        await wait_until(lambda: harness.states("a").count("ready") == 2)

    assert (await harness.play(freeze, faulty_process("good", "/a"))).restarts == 1


async def no_heartbeat_at_all(harness: SupervisorHarness) -> None:
    """While the router answers, the fault is the topic's, and no process is killed."""
    await _lose_the_topic(harness, flood=False)


async def heartbeats_lost_in_a_flood(harness: SupervisorHarness) -> None:
    """The fault is the flooding publisher's, and no process is killed."""
    await _lose_the_topic(harness, flood=True)


async def heartbeats_that_are_late(harness: SupervisorHarness) -> None:
    """While those of one process are long on their way, another's may be as well, and it is not killed."""

    async def lose(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        late = supervisor.processes["b"]._heartbeats["/b"]
        harness.bus.mute, harness.bus.delay_s = {"/b"}, LATE_HEARTBEAT_S + 0.1
        await wait_until(lambda: late.silence(time.monotonic()) > HEARTBEAT_TIMEOUT_S + RECOVERY_S)
        assert harness.states("b")[-1] == "ready"
        harness.bus.delay_s = LATE_HEARTBEAT_S
        await wait_until(lambda: "backing off" in harness.states("b"))
        assert "backing off" not in harness.states("a")

    await harness.play(lose, faulty_process("good", "/a"), faulty_process("good", "/b"))


async def _lose_the_topic(harness: SupervisorHarness, flood: bool) -> None:
    async def lose(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        processes, bus = supervisor.processes.values(), harness.bus
        bus.mute, bus.answers_router, bus.flooded = {"/a", "/b"}, not flood, flood
        await wait_until(
            lambda: (
                bus.published[-1].note
                and all(
                    heartbeat.silence(time.monotonic()) > HEARTBEAT_TIMEOUT_S + 0.5
                    for each in processes
                    for heartbeat in each._heartbeats.values()
                )
            )
        )
        assert ("flood" if flood else "no heartbeat of any process") in bus.published[-1].note
        assert harness.notes[-1].startswith(bus.published[-1].note)
        bus.mute, bus.answers_router, bus.flooded = set(), False, False
        await wait_until(
            lambda: bus.published[-1].note == "" and all(each.is_healthy(time.monotonic()) for each in processes)
        )
        assert all("backing off" not in harness.states(name) for name in "ab")
        assert len(harness.notes) == 2, "it is told once, and that it is over"

    assert (await harness.play(lose, faulty_process("good", "/a"), faulty_process("good", "/b"))).ended == "interrupted"


async def no_heartbeat_and_no_router(harness: SupervisorHarness) -> None:
    """Without an answer from the router, each process is judged by its own heartbeat."""

    async def lose(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        harness.bus.mute = {"/a", "/b"}
        await wait_until(lambda: all("backing off" in harness.states(name) for name in "ab"))

    assert (await harness.play(lose, faulty_process("good", "/a"), faulty_process("good", "/b"))).ended == "interrupted"


async def silence_while_the_router_is_down(harness: SupervisorHarness) -> None:
    """A hung router silences all processes, and is back some time before their heartbeats arrive again."""

    async def silence(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        harness.bus.mute = {"/router", "/a"}
        await wait_until(lambda: harness.states("router").count("starting") == 2)
        harness.bus.mute = {"/a"}
        await wait_until(lambda: supervisor.processes["router"].state == "ready")
        await sleep(1.0)
        harness.bus.mute = set()
        await sleep(HEARTBEAT_TIMEOUT_S)

    outcome = await harness.play(
        silence, faulty_process("good", "/router"), faulty_process("good", "/a", depends_on=("router",))
    )
    assert harness.states("a") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert outcome.restarts == 1


async def process_that_never_beats_is_given_up_after_its_grace(harness: SupervisorHarness) -> None:
    harness.grace = 0.3

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")

    await harness.play(watch, faulty_process("silent", "/a", policy=FAST_POLICY))
    assert "ready" not in harness.states("a")
    assert "no heartbeat" in harness.log("a")


async def beats_of_another_life_do_not_count(harness: SupervisorHarness) -> None:
    harness.grace = 1.0
    (harness.folder / "beats").write_text('{"node": "/a", "pid": 1}\n')

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "backing off")

    await harness.play(watch, faulty_process("silent", "/a"))
    assert "ready" not in harness.states("a")


async def crash_loop_fails_and_leaves_the_others_alone(harness: SupervisorHarness) -> None:
    async def watch(supervisor: Supervisor) -> None:
        a, b = (supervisor.processes[name] for name in "ab")
        await wait_until(lambda: a.state == "failed" and b.state == "ready")

    outcome = await harness.play(
        watch, faulty_process("crash_at_once", "/a", policy=FAST_POLICY), faulty_process("good", "/b")
    )
    assert harness.states("a").count("starting") == 1 + FAST_POLICY.limit
    assert harness.states("b").count("starting") == 1
    assert outcome.restarts == FAST_POLICY.limit
    assert outcome.ended == "interrupted"
    shown = next(each for each in harness.bus.published[-1].processes if each.name == "a")
    assert (shown.state, shown.exit_status) == ("failed", 1)
    assert "restarted 3 times" in shown.reason
    assert "bad config" in harness.log("a")


async def bad_input_is_final_and_its_reason_is_told(harness: SupervisorHarness) -> None:
    bad = faulty_process("bad_input", "/a", policy=FAST_POLICY, required=True)

    async def wait(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")

    outcome = await harness.play(wait, bad, faulty_process("good", "/b"))
    assert harness.states("a").count("starting") == 1
    assert (outcome.ended, outcome.restarts) == ("failed", 0)
    assert outcome.reason == "a failed: exit status 2: a: there is no file reference.csv"


async def program_that_does_not_exist_fails(harness: SupervisorHarness) -> None:
    missing = faulty_process("good", "/a", policy=FAST_POLICY, required=True)

    async def wait(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")

    outcome = await harness.play(wait, msgspec.structs.replace(missing, argv=("/nowhere/program",)))
    assert outcome.ended == "failed"
    assert "cannot start /nowhere/program" in harness.log("a")


def test_restarts(tmp_path: Path) -> None:
    play_side_by_side(
        tmp_path,
        (
            killed_process_is_ready_again_soon,
            hanging_loop,
            endless_loop,
            stopped_process,
            no_heartbeat_at_all,
            heartbeats_lost_in_a_flood,
            heartbeats_that_are_late,
            no_heartbeat_and_no_router,
            silence_while_the_router_is_down,
            process_that_never_beats_is_given_up_after_its_grace,
            beats_of_another_life_do_not_count,
            crash_loop_fails_and_leaves_the_others_alone,
            bad_input_is_final_and_its_reason_is_told,
            program_that_does_not_exist_fails,
        ),
    )
