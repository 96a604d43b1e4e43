"""Both loops on the bus: scripts tick by tick, and keys through pauses, resets and silence."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest

from messages.elea import BaseStatus
from messages.geometry import STOP, Twist, TwistStamped
from services.runtime.context import Context
from services.runtime.errors import BadInput, Stopped
from services.teleop import TeleopParameters
from services.teleop.keys import KeyEvent
from services.teleop.loop import run, run_keyboard
from services.teleop.robot import CommandPublisher
from tests.harness.waiting import wait_until
from tests.services.teleop.loop_harness import FakeDisplay, FakeKeyboard, LoopHarness, run_loop

AHEAD = Twist.planar(0.5, 0.0)
TICK = 0.02
DRIVE = TeleopParameters(keys="i@0.1-1.1", give_way=0.5, stamped=True, frame_id="base_link")
HAND = TeleopParameters(key_timeout=5.0, give_way=0.5)


def play(rig: LoopHarness, seconds: float, epoch: int = 0) -> list[TwistStamped]:
    """Advance time from 0 tick by tick; return the commands, stamped with their ticks."""
    heard: list[TwistStamped] = []
    for number in range(round(seconds / TICK)):
        if rig.ended:
            break
        rig.tick(number * TICK, epoch)
        heard += rig.received_commands()
    return heard


def split(heard: list[TwistStamped]) -> tuple[list[float], list[float]]:
    """Return the times [s] of the commands to move and of those to stop."""
    moving = [each.header.stamp.ns / 1e9 for each in heard if each.twist == AHEAD]
    still = [each.header.stamp.ns / 1e9 for each in heard if each.twist == STOP]
    assert len(moving) + len(still) == len(heard)
    return moving, still


def test_a_script_drives_for_as_long_as_its_key_is_held_then_holds_zero_and_ends() -> None:
    with run_loop(run, DRIVE, stamped=True) as rig:
        heard = play(rig, 3.0)
        assert rig.ended
        heard += rig.received_commands()
    assert {each.header.frame_id for each in heard} == {"base_link"}
    moving, still = split(heard)
    assert moving[0] == pytest.approx(0.1)
    assert max(b - a for a, b in pairwise(moving)) <= 0.061
    # The last repeat is at 1.08, and its time-out 0.1.
    assert moving[-1] < still[0] == pytest.approx(1.2)
    assert max(b - a for a, b in pairwise(still)) <= 0.061
    assert 1.6 < still[-1] < 1.71


def test_a_script_begins_anew_when_time_does() -> None:
    with run_loop(run, DRIVE, stamped=True) as rig:
        before, _ = split(play(rig, 0.6))
        after, still = split(play(rig, 3.0, epoch=1) + rig.received_commands())
    assert before[0] == after[0] == pytest.approx(0.1)
    assert still[0] == pytest.approx(1.2)


def test_a_script_that_is_none_is_refused_before_anything_else() -> None:
    with pytest.raises(BadInput, match="not KEY@TIME"), run_loop(run, TeleopParameters(keys="go")):
        pass


def test_a_base_that_takes_another_type_is_told() -> None:
    with (
        pytest.raises(BadInput, match=r"/p3dx/cmd_vel takes geometry_msgs/TwistStamped, .* set stamped=true"),
        run_loop(run, TeleopParameters(keys="i@0"), stamped=True),
    ):
        pass


@contextmanager
def sitting(params: TeleopParameters = HAND) -> Iterator[tuple[LoopHarness, FakeKeyboard, FakeDisplay]]:
    """Run the loop with a fake keyboard and display."""
    keys, glass = FakeKeyboard(), FakeDisplay()

    def loop(ctx: Context[TeleopParameters]) -> None:
        mouth = CommandPublisher(ctx)
        try:
            run_keyboard(ctx, keys, glass, mouth)  # type: ignore[arg-type]
        finally:
            mouth.close()

    with run_loop(loop, params) as rig:
        rig.publish_clock(1.0)
        wait_until(lambda: glass.view is not None and not glass.view.error, 20.0, "the clock to be seen")
        yield rig, keys, glass


def sends(glass: FakeDisplay) -> object:
    """Return the command that the display shows as sent."""
    assert glass.view is not None
    return glass.view.sent


def test_a_key_goes_out_and_comes_again_without_any_clock() -> None:
    with sitting() as (rig, keys, _):
        keys.press("i")
        heard: list[object] = []
        wait_until(lambda: heard.extend(rig.received_commands()) or heard.count(AHEAD) >= 5, 20.0, "five commands")


def test_it_says_nothing_until_a_key_moves_and_scaling_moves_nothing() -> None:
    with sitting() as (rig, keys, glass):
        keys.press("q")
        wait_until(lambda: glass.view is not None and glass.view.speed > 0.54, 20.0, "the new speed")
        assert rig.received_commands() == []
        keys.press("i")
        rig.wait_for_command(Twist.planar(0.55, 0.0))


def test_through_a_pause_zero_is_held_until_time_has_gone_on() -> None:
    with sitting() as (rig, keys, glass):
        keys.press("i")
        rig.wait_for_command(AHEAD)
        rig.publish_clock(1.5, paused=True)
        keys.press("k")
        rig.wait_for_command(STOP)
        for _ in range(5):
            rig.wait_for_command(STOP, "zero, again and again")
            rig.publish_clock(1.5, paused=True)
        assert glass.view is not None
        assert glass.view.error == "the simulation is paused"
        rig.publish_clock(2.1)
        wait_until(lambda: sends(glass) is None, 20.0, "silence")


def test_a_reset_of_time_silences_it_and_the_held_key_drives_on() -> None:
    with sitting() as (rig, keys, glass):
        keys.press("k")
        rig.wait_for_command(STOP)
        rig.publish_clock(0.0, epoch=1)
        wait_until(lambda: sends(glass) is None, 20.0, "silence")
        keys.press("i")
        rig.wait_for_command(AHEAD)
        rig.publish_clock(0.1, epoch=2)
        wait_until(lambda: rig.driver is not None and rig.driver.subscribers[0].received >= 3, 20.0, "the second reset")
        rig.wait_for_command(AHEAD)


def test_a_loop_that_is_held_up_does_not_take_a_held_key_for_released() -> None:
    """Each key is followed by a stall longer than the time-out, during which the next one is pressed."""

    class Slow(FakeKeyboard):
        def read_events(self, within: float) -> list[KeyEvent]:
            found = [KeyEvent("i", time.monotonic())]
            time.sleep(0.15)
            return found

    def loop(ctx: Context[TeleopParameters]) -> None:
        run_keyboard(ctx, Slow(), FakeDisplay(), CommandPublisher(ctx))  # type: ignore[arg-type]

    with run_loop(loop, TeleopParameters(key_timeout=0.1)) as rig:
        heard: list[object] = []
        wait_until(lambda: heard.extend(rig.received_commands()) or len(heard) >= 5, 20.0, "five commands")
    assert heard == [AHEAD] * len(heard)


def test_the_last_command_is_zero_when_it_drives() -> None:
    with sitting() as (rig, keys, _):
        keys.press("i")
        rig.wait_for_command(AHEAD)
    last = rig.received_commands()
    assert last[-1] == STOP
    assert STOP not in last[:-1]


def test_when_it_is_silent_it_leaves_without_a_word() -> None:
    with sitting() as (rig, _, _):
        pass
    assert rig.received_commands() == []


def test_a_keyboard_that_is_gone_stops_the_robot() -> None:
    class Gone(FakeKeyboard):
        def read_events(self, within: float) -> list[object]:  # type: ignore[override]
            found = super().read_events(within)
            if any(each.key == "x" for each in found):
                raise Stopped("the terminal was closed")
            return list(found)

    keys = Gone()

    def loop(ctx: Context[TeleopParameters]) -> None:
        mouth = CommandPublisher(ctx)
        try:
            run_keyboard(ctx, keys, FakeDisplay(), mouth)  # type: ignore[arg-type]
        finally:
            mouth.close()

    with run_loop(loop, HAND) as rig:
        keys.press("i")
        rig.wait_for_command(AHEAD)
        keys.press("x")
        wait_until(lambda: rig.ended, 20.0, "the end")
        assert rig.received_commands()[-1] == STOP


def test_the_screen_tells_of_the_base_and_of_a_clock_that_is_gone() -> None:
    with sitting() as (rig, _, glass):
        rig.publish_status(BaseStatus(source="/p3dx/teleop", e_stopped=True))
        wait_until(lambda: glass.view is not None and glass.view.base_status is not None, 20.0, "the base")
        assert glass.view is not None
        assert glass.view.base_status is not None
        assert glass.view.base_status.e_stopped
        wait_until(lambda: glass.view is not None and "no clock for" in glass.view.error, 20.0, "the missing clock")
