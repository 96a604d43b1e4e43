"""The processor time by which a script counts as ready."""

from __future__ import annotations

import threading

from services.script.node_loop import OwnTime, run_delay


def test_time_in_which_others_had_the_processor_does_not_count() -> None:
    wall, waited = [100.0], [7.0]
    own = OwnTime(threading.main_thread(), lambda: wall[0], lambda _: waited[0])
    wall[0], waited[0] = 160.0, 62.5
    assert not own.exceeds(5.0), "4.5 s are left of 60"
    wall[0] = 161.0
    assert own.exceeds(5.0), "it slept, or ran, for more"
    idle = OwnTime(threading.main_thread(), lambda: wall[0], lambda _: 0.0)
    wall[0] = 166.5
    assert idle.exceeds(5.0)


def test_the_system_tells_how_long_a_thread_has_waited() -> None:
    first = run_delay(threading.main_thread())
    assert 0.0 <= first <= run_delay(threading.main_thread())
    never_started = threading.Thread()
    assert run_delay(never_started) == 0.0
