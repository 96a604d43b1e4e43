"""When commands go out, in two times: held keys, released ones, pauses, slow and fast simulations."""

from __future__ import annotations

import itertools

from services.motion.voice import Voice
from services.teleop.hand import STILL, Motion

AHEAD, TURN = Motion(0.2), Motion(yaw=1.0)
GIVE_WAY = 3.0


def said(
    voice: Voice, motion: Motion | None, wall: tuple[float, float], factor: float = 1.0, start: float = 0.0
) -> list[tuple[float, Motion]]:
    """What it says in turns of 0.02 s from and to these wall times, each with the wall time."""
    out = []
    for turn in range(round((wall[1] - wall[0]) / 0.02)):
        now = wall[0] + turn * 0.02
        if (words := voice.say(motion, now, start + (now - wall[0]) * factor)) is not None:
            out.append((now, words))
    return out


def gaps(words: list[tuple[float, Motion]]) -> float:
    return max(b - a for (a, _), (b, _) in itertools.pairwise(words))


def test_it_begins_silent() -> None:
    assert said(Voice(20, GIVE_WAY, STILL), None, (0, 10)) == []


def test_a_motion_goes_out_at_once_and_then_twenty_times_a_second() -> None:
    words = said(Voice(20, GIVE_WAY, STILL), AHEAD, (5, 7))
    assert words[0] == (5, AHEAD)
    assert gaps(words) < 0.07
    assert {motion for _, motion in words} == {AHEAD}


def test_it_repeats_at_another_rate_when_told() -> None:
    voice = Voice(20.0, 3.0, STILL)
    ahead = Motion(0.5)
    assert voice.say(ahead, 0.0, 0.0) == ahead
    voice.retune(100.0, 1.0)
    assert voice.say(ahead, 0.02, 0.02) == ahead
    assert voice.say(None, 0.1, 0.1) == STILL
    assert voice.say(None, 1.2, 1.2) is None
    assert voice.state == "silent"


def test_a_change_goes_out_at_once() -> None:
    voice = Voice(20, GIVE_WAY, STILL)
    assert voice.say(AHEAD, 0, 0) == AHEAD
    assert voice.say(AHEAD, 0.01, 0.01) is None
    assert voice.say(TURN, 0.02, 0.02) == TURN
    assert voice.say(None, 0.03, 0.03) == STILL


def test_zero_is_held_and_then_it_falls_silent() -> None:
    voice = Voice(20, GIVE_WAY, STILL)
    voice.say(AHEAD, 0, 0)
    words = said(voice, None, (0.02, 10), start=0.02)
    assert words[0] == (0.02, STILL)
    assert {motion for _, motion in words} == {STILL}
    assert gaps(words) < 0.07
    assert 2.9 < words[-1][0] < 3.02 + 0.001
    assert voice.state == "silent"


def test_through_a_pause_zero_is_held() -> None:
    """Time stands still, and so does the time to give way: the robot learns of the stop when it goes on."""
    voice = Voice(20, GIVE_WAY, STILL)
    voice.say(AHEAD, 0, 5.0)
    assert gaps(said(voice, None, (0.02, 20), factor=0.0, start=5.0)) < 0.07
    assert said(voice, None, (20, 30), start=5.0)[-1][0] < 23.01
    assert voice.state == "silent"


def test_in_a_slow_simulation_zero_is_held_for_as_long_as_it_takes() -> None:
    voice = Voice(20, GIVE_WAY, STILL)
    voice.say(AHEAD, 0, 0)
    last, _ = said(voice, None, (0.02, 60), factor=0.1)[-1]
    assert 29.9 < last < 30.1


def test_in_a_fast_simulation_commands_keep_up_with_its_time() -> None:
    words = said(Voice(20, GIVE_WAY, STILL), AHEAD, (0, 2), factor=8.0)
    assert gaps(words) * 8.0 <= 0.17


def test_a_stop_key_holds_a_robot_that_others_drive() -> None:
    voice = Voice(20, GIVE_WAY, STILL)
    assert voice.say(None, 0, 0, struck=True, stop=True) == STILL
    assert voice.state == "stopping"


def test_a_key_that_scales_says_nothing() -> None:
    assert Voice(20, GIVE_WAY, STILL).say(None, 0, 0, struck=True) is None


def test_without_repeats_a_command_goes_out_with_each_key_event() -> None:
    voice = Voice(0, GIVE_WAY, STILL)
    assert voice.say(AHEAD, 0, 0, struck=True) == AHEAD
    assert said(voice, AHEAD, (0.02, 5)) == []
    assert voice.say(AHEAD, 5, 5, struck=True) == AHEAD
    assert said(voice, None, (5.02, 20)) == [(5.02, STILL)]


def test_when_time_begins_anew_it_is_silent_until_a_key_is_held() -> None:
    voice = Voice(20, GIVE_WAY, STILL)
    voice.say(AHEAD, 0, 100)
    voice.restart()
    assert said(voice, None, (0.02, 1)) == []
    assert voice.say(AHEAD, 1, 0.5) == AHEAD
