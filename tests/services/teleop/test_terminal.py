"""Teleop in a real terminal with a simulated robot: taps, holds, releases, two keys, and every way to quit."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from itertools import dropwhile, pairwise
from math import inf

import pytest

from messages.std import Bool
from messages.topics import E_STOP
from services.runtime.errors import TRY_AGAIN
from services.sim.time_modes import MAX_LAG_S
from tests.harness.cases import case
from tests.harness.robot_recorder import STANDSTILL_SPEED, CommandSample
from tests.harness.waiting import wait_until
from tests.services.teleop.pseudo_terminal import KeyEvents, PseudoTerminal, hold_without_lag
from tests.services.teleop.simulated_robot import (
    MAX_SPEED,
    WITHIN_S,
    SimulatedRobot,
    assert_moved_smoothly,
    simulated_robot,
    teleop_terminal,
    wall_ns,
)

pytestmark = pytest.mark.waits

LET_GO_S = 0.4
"""Wall time [s] to detect a released key on a busy machine; without learning the keyboard's delay it would be 0.6."""
SILENCE = re.compile(r"sends   (?!nothing).*sends   nothing: others may drive", re.DOTALL)
"""What the display has shown once a command was sent and nothing is sent any longer."""
COMMAND_NS = 80_000_000
"""Longest time [ns] between two commands of a teleop that is not held up: its period is 50 ms, and its loop's 20 ms."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimulatedRobot]:
    with simulated_robot(tmp_path_factory.mktemp("teleop")) as drive:
        yield drive


def assert_stopped_soon(drive: SimulatedRobot, strokes: KeyEvents) -> None:
    """Assert that zero was sent soon after the last event, without the time in which nothing was sent at all, and the
    robot stopped.
    """
    last = wall_ns(strokes.times[-1])
    stop = drive.first_zero_after(strokes.times[-1]).sent
    sent = [last, *(each.sent for each in drive.recorder.command_samples if last < each.sent <= stop)]
    stalled = sum(max(0, after - before - COMMAND_NS) for before, after in pairwise(sent))
    assert stop - last - stalled < LET_GO_S * 1e9, f"{len(sent) - 2} commands until then"
    drive.wait_standing()


def test_a_tap_drives_for_the_first_time_out_and_zero_is_held_and_then_nothing_is_sent(drive: SimulatedRobot) -> None:
    with teleop_terminal(drive) as terminal:
        gone, shown = 0.0, 0

        def tapped() -> KeyEvents:
            """Tap once, starting at standstill; it counts as late if simulation time fell behind meanwhile."""
            nonlocal gone, shown
            drive.wait_standing()
            start, shown = drive.recorder.samples[-1], len(terminal.text)
            struck = terminal.type("i")
            begin = wall_ns(struck)

            def zeros() -> list[CommandSample]:
                """Return the zeros after the motion; those of a tap before may still be sent when the key is typed."""
                drive.poll()
                sent = (each for each in drive.recorder.command_samples if each.sent > begin)
                return [each for each in dropwhile(lambda each: not each.moves, sent) if not each.moves]

            stop = wait_until(zeros, WITHIN_S, "a zero after a motion")[0]
            wait_until(lambda: drive.poll() or drive.recorder.first_stop_after(stop.sent), WITHIN_S, "a stop")
            stood = drive.recorder.first_stop_after(stop.sent)
            assert stood is not None
            gone = stood.x - start.x
            return KeyEvents((struck,), inf if drive.lag(start, stood) > MAX_LAG_S else 0.0)

        hold_without_lag(tapped)
        assert 0.03 < gone < 0.22
        wait_until(lambda: drive.poll() or SILENCE.search(terminal.text, shown), WITHIN_S, "silence")
        silent = time.time_ns()
        drive.wait(1.0)
        assert drive.status().source == ""
        assert not [each for each in drive.recorder.command_samples if each.sent > silent]


def test_a_held_key_drives_smoothly_from_its_first_event_and_a_released_one_stops(drive: SimulatedRobot) -> None:
    """The first repeat arrives after 0.5 s, twice the base's time-out."""
    with teleop_terminal(drive) as terminal:
        strokes = hold_without_lag(lambda: held(drive, terminal, "i"))
        assert_moved_smoothly(drive, strokes)
        assert_stopped_soon(drive, strokes)


def test_a_keyboard_with_a_delay_of_a_second_is_learned_from_the_first_hold(drive: SimulatedRobot) -> None:
    with teleop_terminal(drive) as terminal:
        hold_without_lag(lambda: held(drive, terminal, "i", delay=1.0))
        strokes = hold_without_lag(lambda: held(drive, terminal, ",", delay=1.0))
        assert_moved_smoothly(drive, strokes)
        assert_stopped_soon(drive, strokes)


def test_two_keys_follow_each_other_without_a_stop_between(drive: SimulatedRobot) -> None:
    with teleop_terminal(drive) as terminal:
        strokes = hold_without_lag(lambda: held(drive, terminal, "iu", seconds=0.8))
        assert_moved_smoothly(drive, strokes)
        turning = strokes.times[len(strokes.times) // 2 :]
        assert min(each.speed for each in drive.samples_between(turning[0], turning[-1])) > 0.95 * MAX_SPEED
        assert_stopped_soon(drive, strokes)


def test_a_speed_key_changes_what_is_sent(drive: SimulatedRobot) -> None:
    with teleop_terminal(drive, "--speed", "0.1", "--key-timeout", "5") as terminal:
        terminal.type("iw")
        wait_until(lambda: "+0.11 m/s ahead" in terminal.text, WITHIN_S, "the new speed")
        terminal.type("k")
        drive.wait_standing()


def held(
    drive: SimulatedRobot, terminal: PseudoTerminal, keys: str, seconds: float = 1.5, delay: float = 0.5
) -> KeyEvents:
    """Hold one key after the other, starting at standstill and without a key held before.

    A hold also counts as late if a command timed out at the base or simulation time fell behind.
    """
    terminal.type("k")
    drive.wait_standing()
    before = drive.status().commands_timed_out
    strokes = terminal.hold(keys, seconds, delay)
    paused = drive.status().commands_timed_out > before
    first, *_, last = drive.samples_between(strokes.times[0], strokes.times[-1])
    return strokes._replace(late=inf) if paused or drive.lag(first, last) > MAX_LAG_S else strokes


def test_any_other_key_stops_at_once_even_those_that_suspend_or_hold_a_terminal(drive: SimulatedRobot) -> None:
    with teleop_terminal(drive, "--key-timeout", "5") as terminal:
        for key in ("k", " ", "\x1a", "\x13", "\x1c", "\x1bOA"):
            with case(repr(key)):
                terminal.type("i")
                wait_until(lambda: drive.poll() or drive.recorder.speed > 0.95 * MAX_SPEED, WITHIN_S, "full speed")
                drive.first_zero_after(terminal.type(key))
                drive.wait_standing()
        terminal.type("q")
        wait_until(lambda: "0.55 m/s" in terminal.text, WITHIN_S, "a teleop that goes on")


def test_it_obeys_the_emergency_stop_and_shows_it(drive: SimulatedRobot) -> None:
    with drive.network.node("watch") as node, teleop_terminal(drive, "--key-timeout", "5") as terminal:
        told = node.advertise(E_STOP, "/rover/e_stop")
        wait_until(lambda: drive.poll() or told.has_subscribers, WITHIN_S, "a base that listens")
        told.publish(Bool(data=True))
        wait_until(lambda: drive.poll() or drive.recorder.base.e_stopped, WITHIN_S, "an emergency stop")
        since = terminal.type("i")
        wait_until(lambda: "EMERGENCY STOP" in terminal.text, WITHIN_S, "the display to tell of it")
        wait_until(lambda: drive.poll() or drive.commands_between(since, since + 60), WITHIN_S, "commands")
        drive.wait(0.5)
        assert all(abs(each.speed) < STANDSTILL_SPEED for each in drive.samples_between(since, since + 60))
        told.publish(Bool(data=False))
        wait_until(lambda: drive.poll() or not drive.recorder.base.e_stopped, WITHIN_S, "the end of it")
        terminal.type("k")


@pytest.mark.parametrize("way", ["Ctrl-C", "SIGTERM", "SIGHUP"])
def test_on_leaving_the_robot_stops_and_the_terminal_is_as_it_was(drive: SimulatedRobot, way: str) -> None:
    with teleop_terminal(drive, "--key-timeout", "5") as terminal:
        assert terminal.attributes != terminal.before
        terminal.type("i")
        wait_until(lambda: drive.poll() or drive.recorder.speed > 0.95 * MAX_SPEED, WITHIN_S, "full speed")
        left = terminal.type("\x03") if way == "Ctrl-C" else terminal.send_signal(signal.Signals[way])
        assert terminal.wait() == 0, terminal.text
        assert terminal.attributes == terminal.before
        assert "Traceback" not in terminal.text
        drive.first_zero_after(left)
        drive.wait_standing()
    drive.wait(0.3)
    assert not drive.recorder.command_samples[-1].moves


def test_a_window_that_is_closed_stops_the_robot(drive: SimulatedRobot) -> None:
    with teleop_terminal(drive, "--key-timeout", "5") as terminal:
        terminal.type("i")
        wait_until(lambda: drive.poll() or drive.recorder.speed > 0.95 * MAX_SPEED, WITHIN_S, "full speed")
        terminal.close()
        assert terminal.wait() == 0
        drive.wait_standing()
    drive.wait(0.5)
    assert not drive.recorder.command_samples[-1].moves


@pytest.mark.parametrize(("fault", "status"), [("raise", 1), ("thread", 70)])
def test_after_an_error_the_terminal_is_as_it_was(fault: str, status: int) -> None:
    with PseudoTerminal(["-m", "tests.services.teleop.failing_program", fault]) as terminal:
        terminal.wait_ready()
        terminal.type("i")
        assert terminal.wait() == status
        assert terminal.attributes == terminal.before
        wait_until(lambda: "on purpose" in terminal.text, WITHIN_S, "the traceback")


def test_a_second_teleop_of_a_robot_is_refused(drive: SimulatedRobot) -> None:
    with (
        teleop_terminal(drive),
        PseudoTerminal(["-m", "deploy", "teleop", "--connect", drive.network.endpoint]) as second,
    ):
        assert second.wait() == TRY_AGAIN
        wait_until(lambda: "a node /rover/teleop is already there" in second.text, WITHIN_S, "the reason")
        assert second.attributes == second.before


def test_a_robot_that_is_not_there_is_told_with_those_that_are(drive: SimulatedRobot) -> None:
    with PseudoTerminal(["-m", "deploy", "teleop", "/rovr", "--connect", drive.network.endpoint]) as terminal:
        assert terminal.wait() == 2
        wait_until(lambda: "did you mean '/rover'? (known: /rover)" in terminal.text, WITHIN_S, "the reason")


def test_no_router_is_told() -> None:
    with PseudoTerminal(["-m", "deploy", "teleop", "--connect", "tcp/127.0.0.1:1"]) as terminal:
        assert terminal.wait() == 2
        wait_until(lambda: "no router at tcp/127.0.0.1:1" in terminal.text, WITHIN_S, "the reason")
