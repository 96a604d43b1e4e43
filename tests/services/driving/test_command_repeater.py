"""When commands are published, in wall and simulation time: keys held and released, pauses, slow and fast time."""

from __future__ import annotations

import itertools

from services.driving.command_repeater import CommandRepeater
from services.teleop.keys import ZERO_VELOCITY, Velocity

AHEAD, TURN = Velocity(0.2), Velocity(yaw=1.0)
GIVE_WAY = 3.0


def said(
    voice: CommandRepeater, motion: Velocity | None, wall: tuple[float, float], factor: float = 1.0, start: float = 0.0
) -> list[tuple[float, Velocity]]:
    """Update every 0.02 s between two wall times [s]; return the published commands, each with its wall time."""
    out = []
    for turn in range(round((wall[1] - wall[0]) / 0.02)):
        now = wall[0] + turn * 0.02
        if (words := voice.update(motion, now, start + (now - wall[0]) * factor)) is not None:
            out.append((now, words))
    return out


def gaps(words: list[tuple[float, Velocity]]) -> float:
    return max(b - a for (a, _), (b, _) in itertools.pairwise(words))


def test_it_begins_silent() -> None:
    assert said(CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY), None, (0, 10)) == []


def test_a_motion_goes_out_at_once_and_then_twenty_times_a_second() -> None:
    words = said(CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY), AHEAD, (5, 7))
    assert words[0] == (5, AHEAD)
    assert gaps(words) < 0.07
    assert {motion for _, motion in words} == {AHEAD}


def test_it_repeats_at_another_rate_when_told() -> None:
    voice = CommandRepeater(20.0, 3.0, ZERO_VELOCITY)
    ahead = Velocity(0.5)
    assert voice.update(ahead, 0.0, 0.0) == ahead
    voice.reconfigure(100.0, 1.0)
    assert voice.update(ahead, 0.02, 0.02) == ahead
    assert voice.update(None, 0.1, 0.1) == ZERO_VELOCITY
    assert voice.update(None, 1.2, 1.2) is None
    assert voice.state == "silent"


def test_a_change_goes_out_at_once() -> None:
    voice = CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY)
    assert voice.update(AHEAD, 0, 0) == AHEAD
    assert voice.update(AHEAD, 0.01, 0.01) is None
    assert voice.update(TURN, 0.02, 0.02) == TURN
    assert voice.update(None, 0.03, 0.03) == ZERO_VELOCITY


def test_zero_is_held_and_then_it_falls_silent() -> None:
    voice = CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY)
    voice.update(AHEAD, 0, 0)
    words = said(voice, None, (0.02, 10), start=0.02)
    assert words[0] == (0.02, ZERO_VELOCITY)
    assert {motion for _, motion in words} == {ZERO_VELOCITY}
    assert gaps(words) < 0.07
    assert 2.9 < words[-1][0] < 3.02 + 0.001
    assert voice.state == "silent"


def test_through_a_pause_zero_is_held() -> None:
    """Zero is repeated for a span of simulation time: a paused robot still receives the stop when it resumes."""
    voice = CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY)
    voice.update(AHEAD, 0, 5.0)
    assert gaps(said(voice, None, (0.02, 20), factor=0.0, start=5.0)) < 0.07
    assert said(voice, None, (20, 30), start=5.0)[-1][0] < 23.01
    assert voice.state == "silent"


def test_in_a_slow_simulation_zero_is_held_for_as_long_as_it_takes() -> None:
    voice = CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY)
    voice.update(AHEAD, 0, 0)
    last, _ = said(voice, None, (0.02, 60), factor=0.1)[-1]
    assert 29.9 < last < 30.1


def test_in_a_fast_simulation_commands_keep_up_with_its_time() -> None:
    words = said(CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY), AHEAD, (0, 2), factor=8.0)
    assert gaps(words) * 8.0 <= 0.17


def test_a_stop_key_holds_a_robot_that_others_drive() -> None:
    voice = CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY)
    assert voice.update(None, 0, 0, key_event=True, stop=True) == ZERO_VELOCITY
    assert voice.state == "stopping"


def test_a_key_that_scales_says_nothing() -> None:
    assert CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY).update(None, 0, 0, key_event=True) is None


def test_without_repeats_a_command_goes_out_with_each_key_event() -> None:
    voice = CommandRepeater(0, GIVE_WAY, ZERO_VELOCITY)
    assert voice.update(AHEAD, 0, 0, key_event=True) == AHEAD
    assert said(voice, AHEAD, (0.02, 5)) == []
    assert voice.update(AHEAD, 5, 5, key_event=True) == AHEAD
    assert said(voice, None, (5.02, 20)) == [(5.02, ZERO_VELOCITY)]


def test_when_time_begins_anew_it_is_silent_until_a_key_is_held() -> None:
    voice = CommandRepeater(20, GIVE_WAY, ZERO_VELOCITY)
    voice.update(AHEAD, 0, 100)
    voice.reset()
    assert said(voice, None, (0.02, 1)) == []
    assert voice.update(AHEAD, 1, 0.5) == AHEAD
