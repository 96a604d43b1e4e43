"""Faults 3 and 4 with all traffic through the router: it freezes with commands in it, and it is killed."""

from __future__ import annotations

import signal
import time
from contextlib import suppress

import psutil
import pytest

from messages.topics import CMD_VEL
from tests.faults.services.faulty_controller import FULL_SPEED as FORWARD
from tests.faults.supervised_fleet import WITHIN_S, SupervisedFleet, send_signal
from tests.faults.test_killed_processes import declared
from tests.harness.robot_recorder import (
    FULL_SPEED,
    LATEST_STOP_S,
    STANDSTILL_SPEED,
    TIMEOUT_S,
    WHEELS,
    TruthSample,
)
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits

BURST = 10
"""Commands sent into the frozen router, and the time between them [s]."""
SPACING_S = 0.02
SHORT_NS = 1_500_000_000
"""Longest freeze [ns] of the router: shorter than the leases of its links, and than it takes to be replaced."""
TRIES = 5
"""Freezes within which one must be short, on a machine on which this test may stand still for longer."""


def pass_time(seconds: float) -> None:
    """Let commands age on the wall clock."""
    end = time.monotonic() + seconds
    wait_until(lambda: time.monotonic() > end)


def test_a_burst_of_old_commands_is_dropped(star: SupervisedFleet) -> None:
    """The commands in the frozen router arrive all at once when it resumes; by then the controller is silent."""
    robot = star.robot("tb3_1")
    with star.node("commander", "star") as node:
        commands = node.advertise(CMD_VEL, "/tb3_1/cmd_vel")
        for _ in range(TRIES):
            star.wait_ready("router")
            star.drive(commands, lambda: robot.speed > FULL_SPEED, "full speed")
            before, router = robot.base.stale_dropped, star.process("router")
            frozen = send_signal(router.pid, signal.SIGSTOP)
            for _ in range(BURST):
                commands.publish(FORWARD)
                pass_time(SPACING_S)
            pass_time(2 * TIMEOUT_S)
            with suppress(psutil.NoSuchProcess):
                continued = send_signal(router.pid, signal.SIGCONT)
                if continued - frozen < SHORT_NS:
                    break
        else:
            raise AssertionError(f"none of {TRIES} freezes was short")

        star.wait(lambda: robot.base.stale_dropped > before, "old commands to be dropped")
        star.wait_simulated(1.0, "tb3_1")
        assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S
        stood = robot.first_stop_after(frozen)
        assert stood is not None
        assert [each for each in robot.samples if each.sent > stood.sent and each.speed >= STANDSTILL_SPEED] == []
        assert star.process("router") == router
        star.drive(commands, lambda: robot.speed > FULL_SPEED, "full speed by fresh commands")


def test_without_the_router_all_robots_stop(star: SupervisedFleet) -> None:
    robots, before = star.recorder.robots, star.process("router")
    with star.node("commander", "star") as node:
        commands = node.advertise(CMD_VEL, "/tb3_1/cmd_vel")
        star.drive(commands, lambda: all(each.speed > FULL_SPEED for each in robots.values()), "full speed")
        graph = declared(star, "early")
        driven = time.time_ns() + round(LATEST_STOP_S * 1e9)

        def drive_on() -> bool:
            return all(each.statuses[-1][0] > driven and each.speed > FULL_SPEED for each in robots.values())

        star.drive(commands, drive_on, "a new status, still at full speed")
        last = {name: track.samples[-1] for name, track in robots.items()}
        timed_out = {name: track.base.commands_timed_out for name, track in robots.items()}
        killed = star.kill("router")
        star.wait_restarted(before)
        star.wait(lambda: all(track.samples[-1].sent > killed + 1e9 for track in robots.values()), "robots in sight")

        unseen_ns = 2 * LATEST_STOP_S * 1e9

        def in_sight() -> TruthSample | None:
            """Return the first sample after a time without the router that is long in simulation time, too."""
            late = (each for each in robots["tb3_1"].samples if each.sent > killed + 1e9)
            return next((each for each in late if each.time > last["tb3_1"].time + unseen_ns), None)

        star.wait(in_sight, "a robot that was long out of sight")
        star.wait_simulated(1.0, "tb3_1")
        seen = in_sight()
        assert seen is not None
        assert seen.x - last["tb3_1"].x <= WHEELS.max_linear * LATEST_STOP_S
        assert [
            each for each in robots["tb3_1"].samples if each.sent >= seen.sent and each.speed >= STANDSTILL_SPEED
        ] == []
        for name, track in robots.items():
            late = len(track.pauses(round(killed - LATEST_STOP_S * 1e9)))
            assert 1 <= track.base.commands_timed_out - timed_out[name] <= 1 + late

        star.wait_full_speed("tb3_0")
        star.drive(commands, lambda: robots["tb3_1"].speed > FULL_SPEED, "full speed by fresh commands")
        wait_until(lambda: declared(star, "late") == graph, WITHIN_S, "everybody declared at the new router")
    restarts = {name: each.restarts for name, each in star.recorder.processes.items() if each.restarts}
    assert restarts == {"router": before.restarts + 1}
