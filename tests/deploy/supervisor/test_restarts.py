"""What the supervisor restarts, how soon, and when it gives up: crashes, hangs and crash loops."""

from __future__ import annotations

import time
from asyncio import sleep
from pathlib import Path

import msgspec
import psutil

from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S
from deploy.supervisor.supervisor import Supervisor
from tests.deploy.supervisor.supervisor_harness import (
    FAST_POLICY,
    SupervisorHarness,
    faulty_process,
    play_side_by_side,
    wait_all_ready,
    wait_until,
)


async def killed_process_is_ready_again_soon(stage: SupervisorHarness) -> None:
    async def kill_one(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        killed = supervisor.processes["a"].state_message().pid
        psutil.Process(killed).kill()
        await wait_until(lambda: supervisor.processes["a"].state == "backing off")
        await wait_all_ready(supervisor)
        assert supervisor.processes["a"].state_message().pid != killed

    outcome = await stage.play(kill_one, faulty_process("good", "/a"), faulty_process("good", "/b"))
    assert stage.states("a")[2:6] == ["ready", "backing off", "waiting", "starting"]
    assert outcome.restarts == 1
    assert stage.states("b") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert "killed by signal 9" in stage.log("a")


async def hanging_loop(stage: SupervisorHarness) -> None:
    """It is killed after three missed beats."""

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: stage.states("a").count("ready") == 2)

    await stage.play(watch, faulty_process("hang_after_start", "/a"))
    assert stage.silence("a") > HEARTBEAT_TIMEOUT_S - 0.2
    assert stage.unexcused_silence("a") < HEARTBEAT_TIMEOUT_S + 1.0


async def endless_loop(stage: SupervisorHarness) -> None:
    """An endless loop isn't mistaken for waiting for a processor."""

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: stage.states("a").count("ready") == 2)

    await stage.play(watch, faulty_process("spin", "/a"))
    assert stage.unexcused_silence("a") < HEARTBEAT_TIMEOUT_S + 1.0


async def stopped_process(stage: SupervisorHarness) -> None:
    """A stopped process counts as hung."""

    async def freeze(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        psutil.Process(supervisor.processes["a"].state_message().pid).suspend()
        await wait_until(lambda: stage.states("a").count("ready") == 2)

    assert (await stage.play(freeze, faulty_process("good", "/a"))).restarts == 1


async def no_heartbeat_at_all(stage: SupervisorHarness) -> None:
    """While the router answers, the fault is the topic's, and no process is killed."""
    await _lose_the_topic(stage, flood=False)


async def heartbeats_lost_in_a_flood(stage: SupervisorHarness) -> None:
    """The fault is the flooding publisher's, and no process is killed."""
    await _lose_the_topic(stage, flood=True)


async def _lose_the_topic(stage: SupervisorHarness, flood: bool) -> None:
    async def lose(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        lives, bus = supervisor.processes.values(), stage.bus
        bus.mute, bus.answers_router, bus.flooded = {"/a", "/b"}, not flood, flood
        await wait_until(
            lambda: all(
                heartbeat.silence(time.monotonic()) > HEARTBEAT_TIMEOUT_S + 0.5
                for each in lives
                for heartbeat in each._heartbeats.values()
            )
        )
        assert ("flood" if flood else "no heartbeat of any process") in bus.published[-1].note
        assert stage.notes[-1].startswith(bus.published[-1].note)
        bus.mute, bus.answers_router, bus.flooded = set(), False, False
        await wait_until(
            lambda: bus.published[-1].note == "" and all(each.is_healthy(time.monotonic()) for each in lives)
        )
        assert all("backing off" not in stage.states(name) for name in "ab")
        assert len(stage.notes) == 2, "it is told once, and that it is over"

    assert (await stage.play(lose, faulty_process("good", "/a"), faulty_process("good", "/b"))).ended == "interrupted"


async def no_heartbeat_and_no_router(stage: SupervisorHarness) -> None:
    """Without an answer from the router, each process is judged by its own heartbeat."""

    async def lose(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        stage.bus.mute = {"/a", "/b"}
        await wait_until(lambda: all("backing off" in stage.states(name) for name in "ab"))

    assert (await stage.play(lose, faulty_process("good", "/a"), faulty_process("good", "/b"))).ended == "interrupted"


async def silence_while_the_router_is_down(stage: SupervisorHarness) -> None:
    """A hung router silences all processes, and is back some time before their heartbeats arrive again."""

    async def silence(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        stage.bus.mute = {"/router", "/a"}
        await wait_until(lambda: stage.states("router").count("starting") == 2)
        stage.bus.mute = {"/a"}
        await wait_until(lambda: supervisor.processes["router"].state == "ready")
        await sleep(1.0)
        stage.bus.mute = set()
        await sleep(HEARTBEAT_TIMEOUT_S)

    outcome = await stage.play(
        silence, faulty_process("good", "/router"), faulty_process("good", "/a", depends_on=("router",))
    )
    assert stage.states("a") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert outcome.restarts == 1


async def process_that_never_beats_is_given_up_after_its_grace(stage: SupervisorHarness) -> None:
    stage.grace = 0.3

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")

    await stage.play(watch, faulty_process("silent", "/a", policy=FAST_POLICY))
    assert "ready" not in stage.states("a")
    assert "no heartbeat" in stage.log("a")


async def beats_of_another_life_do_not_count(stage: SupervisorHarness) -> None:
    stage.grace = 1.0
    (stage.folder / "beats").write_text('{"node": "/a", "pid": 1}\n')

    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "backing off")

    await stage.play(watch, faulty_process("silent", "/a"))
    assert "ready" not in stage.states("a")


async def crash_loop_fails_and_leaves_the_others_alone(stage: SupervisorHarness) -> None:
    async def watch(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")
        assert supervisor.processes["b"].state == "ready"

    outcome = await stage.play(
        watch, faulty_process("crash_at_once", "/a", policy=FAST_POLICY), faulty_process("good", "/b")
    )
    assert stage.states("a").count("starting") == 1 + FAST_POLICY.limit
    assert outcome.restarts == FAST_POLICY.limit
    assert outcome.ended == "interrupted"
    shown = next(each for each in stage.bus.published[-1].processes if each.name == "a")
    assert (shown.state, shown.exit_status) == ("failed", 1)
    assert "restarted 3 times" in shown.reason
    assert "bad config" in stage.log("a")


async def bad_input_is_final_and_its_reason_is_told(stage: SupervisorHarness) -> None:
    bad = faulty_process("bad_input", "/a", policy=FAST_POLICY, required=True)

    async def wait(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")

    outcome = await stage.play(wait, bad, faulty_process("good", "/b"))
    assert stage.states("a").count("starting") == 1
    assert (outcome.ended, outcome.restarts) == ("failed", 0)
    assert outcome.reason == "a failed: exit status 2: a: there is no file reference.csv"


async def program_that_does_not_exist_fails(stage: SupervisorHarness) -> None:
    missing = faulty_process("good", "/a", policy=FAST_POLICY, required=True)

    async def wait(supervisor: Supervisor) -> None:
        await wait_until(lambda: supervisor.processes["a"].state == "failed")

    outcome = await stage.play(wait, msgspec.structs.replace(missing, argv=("/nowhere/program",)))
    assert outcome.ended == "failed"
    assert "cannot start /nowhere/program" in stage.log("a")


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
            no_heartbeat_and_no_router,
            silence_while_the_router_is_down,
            process_that_never_beats_is_given_up_after_its_grace,
            beats_of_another_life_do_not_count,
            crash_loop_fails_and_leaves_the_others_alone,
            bad_input_is_final_and_its_reason_is_told,
            program_that_does_not_exist_fails,
        ),
    )
