"""Interpolated time between two clock messages, and a script's own clock."""

from __future__ import annotations

import pytest

from services.script import clock as clock_module
from services.script.clock import ScriptClock
from services.script.script_time import START_TIME_NS, ScriptTime, datetime_module, time_module

MS = 1_000_000


class Wall:
    """A wall clock that a test moves."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def monotonic(self) -> float:
        return self.seconds


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    made = Wall()
    monkeypatch.setattr(clock_module, "time", made)
    return made


def test_time_goes_on_between_two_clocks_but_never_beyond_one_period_nor_back(wall: Wall) -> None:
    clock = ScriptClock(simulated=True)
    assert not clock.started
    for tick in range(10):
        clock.set(tick * 20 * MS)
        wall.seconds += 0.02
    assert clock.now() == 200 * MS
    wall.seconds += 1.0
    assert clock.now() == 200 * MS, "the next sample is late: time waits"
    clock.set(190 * MS)
    assert clock.now() == 200 * MS
    wall.seconds += 0.015
    clock.set(200 * MS)
    wall.seconds += 0.01
    clock.set(210 * MS, paused=True)
    before = clock.now()
    wall.seconds += 5
    assert clock.now() == before


def test_time_follows_the_speed_of_the_simulation(wall: Wall) -> None:
    clock = ScriptClock(simulated=True)
    for tick in range(20):
        clock.set(tick * 20 * MS)
        wall.seconds += 0.005
    assert clock.wall_until(clock.now() + 40 * MS, clock.now()) == pytest.approx(0.01, rel=0.01)
    clock.set(400 * MS)
    wall.seconds += 0.0025
    assert clock.now() == pytest.approx(410 * MS, abs=MS)


def test_a_reset_counts_once_whether_it_is_an_epoch_or_another_simulation(wall: Wall) -> None:
    clock = ScriptClock(simulated=True)
    clock.set(100 * MS, epoch=3)
    assert clock.epoch == 0
    clock.set(0, epoch=4)
    assert (clock.epoch, clock.now()) == (1, 0)
    clock.set(20 * MS, epoch=4)
    clock.set(0, epoch=4)
    clock.set(20 * MS, epoch=4)
    assert clock.epoch == 2


class Kernel:
    """The part of a kernel that a script's clock uses."""

    def __init__(self) -> None:
        self.time, self.points, self.slept = 1500 * MS, 0.0, list[tuple[str, float]]()

    def now(self) -> int:
        return self.time

    def point(self, cost: float = 1.0) -> None:
        self.points += cost

    def pause(self, seconds: float) -> None:
        self.slept.append(("simulated", seconds))

    def rest(self, seconds: float) -> None:
        self.slept.append(("wall", seconds))


def test_the_script_s_modules_follow_simulation_time() -> None:
    kernel = Kernel()
    clock = ScriptTime(kernel, lambda: True, fixed=True)
    time, datetime = time_module(clock), datetime_module(clock)
    assert time.time() == START_TIME_NS / 1e9 + 1.5
    assert (time.monotonic(), time.perf_counter(), time.clock()) == (1.5, 1.5, 1.5)
    assert time.strftime("%Y", time.gmtime()) == "2020"
    assert (time.asctime(), time.asctime(time.gmtime(0))) == (time.ctime(), "Thu Jan  1 00:00:00 1970")
    assert datetime.datetime.utcnow().isoformat() == "2020-01-01T00:00:01.500000"
    assert datetime.datetime.now() - datetime.datetime.now() == datetime.timedelta(0)
    assert datetime.date.today().year == datetime.datetime.today().year
    assert kernel.points > 5
    time.sleep(0.25)
    with pytest.raises(ValueError, match="non-negative"):
        time.sleep(-1)
    assert kernel.slept == [("simulated", 0.25)]


def test_at_the_wall_clock_s_pace_they_are_python_s_own() -> None:
    import time as real

    kernel = Kernel()
    time = time_module(ScriptTime(kernel, lambda: False, fixed=False))
    assert abs(time.time() - real.time()) < 60
    time.sleep(0.5)
    assert kernel.slept == [("wall", 0.5)]
