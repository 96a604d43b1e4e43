"""Sleeping on simulated time, with a clock of 20 ms steps that advances during sleeps."""

import logging
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from services.script.api import ScriptStopped, TimeMovedBackwards
from services.script.clock import ScriptClock
from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports

_CLOCK_NS = 20_000_000


class _Clock:
    """Simulation time that advances in steps of 20 ms while a script sleeps."""

    def __init__(self, kernel: ScriptKernel) -> None:
        self._kernel = kernel
        self.resets: dict[int, int] = {}
        """Times at which time is set back, each with the new time [ns]."""

    def run_until(self, time_ns: int) -> None:
        kernel = self._kernel
        while (now := kernel.clock.now()) < time_ns:
            if kernel.shutting_down:
                raise ScriptStopped("the process was asked to end")
            if now in self.resets:
                kernel.clock.set(self.resets.pop(now))
                raise TimeMovedBackwards("simulation time was reset")
            kernel.clock.set(now + _CLOCK_NS)

    def wait(self, ready: Callable[[], bool], timeout: float | None = None, by_messages: bool = False) -> bool:
        if not self._kernel.clock.started:
            self._kernel.clock.set(5_000_000_000)
        return ready()


def _repeat(action: Callable[[], None], times: int) -> None:
    for _ in range(times):
        action()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Clock]:
    monkeypatch.setattr(sys, "argv", ["sim.py"])
    with ros1_imports(simulated=True) as kernel:
        import rospy

        rospy.init_node("sim")
        kernel.clock = ScriptClock(simulated=True, interpolated=False)
        made = _Clock(kernel)
        monkeypatch.setattr(kernel, "sleep_until", made.run_until)
        monkeypatch.setattr(kernel, "wait_until", made.wait)
        monkeypatch.setattr(kernel, "spawn", lambda target, name: target())
        yield made
    logging.getLogger("rosout").handlers.clear()


def test_the_first_sleep_waits_for_a_clock(clock: _Clock, capfd: pytest.CaptureFixture[str]) -> None:
    import rospy

    assert rospy.Time.now() == rospy.Time(0)
    rospy.sleep(0.1)
    assert rospy.get_time() == 5.1
    rospy.loginfo("log on sim time")
    assert capfd.readouterr().out.endswith(", 5.100000]: log on sim time\n")


def test_rates_keep_their_mean(clock: _Clock) -> None:
    import rospy

    rospy.sleep(rospy.Duration(1))
    for hertz, seconds in ((10, 1.0), (30, 1.0), (50, 1.0), (7, 3.0)):
        began, rate = rospy.get_time(), rospy.Rate(hertz)
        for _ in range(round(hertz * seconds)):
            rate.sleep()
        assert rospy.get_time() - began == pytest.approx(seconds, abs=0.0201), hertz
    began, rate, count = rospy.get_time(), rospy.Rate(100), 0
    while rospy.get_time() - began < 1.0:
        rate.sleep()
        count += 1
    assert count == 99
    rospy.sleep(0)
    rospy.sleep(-1)


def test_a_late_loop_catches_up_once(clock: _Clock) -> None:
    import rospy

    rospy.sleep(1.0)
    rate = rospy.Rate(10)
    rate.sleep()
    rospy.sleep(0.15)
    late = rospy.get_time()
    rate.sleep()
    assert rospy.get_time() == late
    rate.sleep()
    assert rospy.get_time() == pytest.approx(late + 0.05, abs=0.0201)
    rospy.sleep(1.0)
    late = rospy.get_time()
    rate.sleep()
    rate.sleep()
    assert rospy.get_time() == pytest.approx(late + 0.1, abs=0.0201)
    assert rate.sleep_dur == rospy.Duration(0.1)
    assert rate.remaining().to_sec() == pytest.approx(0.1, abs=0.0201)


def test_time_that_moves_back_interrupts_what_sleeps(clock: _Clock) -> None:
    import rospy

    rate = rospy.Rate(10)
    rospy.sleep(0.1)
    clock.resets = {6_000_000_000: 1_000_000_000}
    with pytest.raises(rospy.ROSTimeMovedBackwardsException, match="ROS time moved backwards") as caught:
        _repeat(rate.sleep, 20)
    assert [each.__name__ for each in type(caught.value).__mro__[1:5]] == [
        "ROSInterruptException",
        "ROSException",
        "Exception",
        "KeyboardInterrupt",
    ]
    assert caught.value.time == pytest.approx(5.0, abs=0.11)
    rate.sleep()
    clock.resets = {2_000_000_000: 1_000_000_000}
    forgiving = rospy.Rate(10, reset=True)
    _repeat(forgiving.sleep, 20)
    assert not clock.resets


def test_timers_call_in_time(clock: _Clock) -> None:
    import rospy

    rospy.sleep(0.1)
    events: list[Any] = []

    def note(event: Any) -> None:
        events.append(event)
        if len(events) == 5:
            rospy.signal_shutdown("enough")

    began = rospy.Time.now()
    rospy.Timer(rospy.Duration(0.1), note)
    assert [each.current_expected - began for each in events] == [rospy.Duration(0.1 * n) for n in range(1, 6)]
    assert [each.current_real for each in events] == [each.current_expected for each in events]
    assert sorted(vars(events[-1])) == [
        "current_expected",
        "current_real",
        "last_duration",
        "last_expected",
        "last_real",
    ]
    assert (events[0].last_expected, events[1].last_expected) == (None, events[0].current_expected)
    assert (events[0].last_duration, type(events[1].last_duration)) == (None, float)


def test_a_oneshot_timer_calls_once(clock: _Clock) -> None:
    import rospy

    rospy.sleep(0.1)
    events: list[Any] = []
    rospy.Timer(rospy.Duration(0.1), events.append, oneshot=True)
    assert len(events) == 1


def test_what_sleeps_after_a_shutdown_is_interrupted(clock: _Clock) -> None:
    import rospy

    rospy.sleep(0.1)
    seen: list[Any] = []

    def stop() -> None:
        before = rospy.get_time()
        rospy.sleep(0.2)
        seen.append((rospy.is_shutdown(), rospy.is_shutdown_requested(), round(rospy.get_time() - before, 2)))

    rospy.on_shutdown(stop)
    rospy.core.add_preshutdown_hook(lambda reason: seen.append(("pre", reason, rospy.is_shutdown())))
    rospy.core.add_shutdown_hook(lambda reason: seen.append(("hook", reason, rospy.is_shutdown())))
    rate = rospy.Rate(1)
    rospy.signal_shutdown("enough")
    rospy.signal_shutdown("again")
    assert seen == [(False, True, 0.2), ("pre", "enough", False), ("hook", "enough", True)]
    for wait in (rate.sleep, lambda: rospy.sleep(60), lambda: rospy.sleep(0)):
        with pytest.raises(rospy.ROSInterruptException, match="ROS shutdown request"):
            wait()
    assert rospy.is_shutdown() is True
    assert rospy.spin() is None
