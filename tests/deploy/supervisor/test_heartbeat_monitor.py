"""When a process counts as hung, on a fake clock."""

from __future__ import annotations

import pytest

from deploy.supervisor.heartbeat_monitor import (
    CPU_WAIT_CHECK_S,
    HEARTBEAT_TIMEOUT_S,
    STARTUP_TIMEOUT_S,
    HeartbeatMonitor,
)
from services.runtime.heartbeat import PERIOD_S


def test_grace_before_the_first_beat() -> None:
    pulse = HeartbeatMonitor(100.0)
    assert not pulse.is_hung(100.0 + STARTUP_TIMEOUT_S)
    assert pulse.is_hung(100.1 + STARTUP_TIMEOUT_S)
    assert not pulse.is_healthy(100.1)


def test_three_missed_beats() -> None:
    pulse = HeartbeatMonitor(0.0)
    pulse.on_heartbeat(5.0)
    assert pulse.is_healthy(4.9 + 2 * PERIOD_S)
    assert not pulse.is_healthy(5.1 + 2 * PERIOD_S)
    assert not pulse.is_hung(5.0 + HEARTBEAT_TIMEOUT_S)
    assert pulse.is_hung(5.01 + HEARTBEAT_TIMEOUT_S)
    pulse.on_heartbeat(7.0)
    assert not pulse.is_hung(7.0 + HEARTBEAT_TIMEOUT_S)


def test_excused_silence_counts_from_the_excuse() -> None:
    pulse = HeartbeatMonitor(0.0)
    pulse.on_heartbeat(1.0)
    pulse.extend_to(4.0, 3.0)
    assert not pulse.is_hung(7.0)
    assert pulse.is_hung(7.1)


def test_an_excuse_never_shortens_the_time() -> None:
    pulse = HeartbeatMonitor(0.0)
    pulse.extend_to(1.0, 1.0)
    assert not pulse.is_hung(STARTUP_TIMEOUT_S)


def test_time_in_which_it_could_not_beat_does_not_count() -> None:
    pulse = HeartbeatMonitor(0.0)
    pulse.on_heartbeat(1.0)
    for _ in range(10):
        pulse.extend_by(0.2)
    assert pulse.cpu_wait_s == pytest.approx(2.0)
    assert not pulse.is_hung(3.0 + HEARTBEAT_TIMEOUT_S)
    assert pulse.is_hung(3.1 + HEARTBEAT_TIMEOUT_S)
    pulse.on_heartbeat(5.0)
    assert pulse.cpu_wait_s == 0.0
    assert pulse.is_hung(5.1 + HEARTBEAT_TIMEOUT_S)


def test_its_silence_is_looked_into_before_it_counts_as_hanging() -> None:
    pulse = HeartbeatMonitor(0.0)
    assert not pulse.is_late(STARTUP_TIMEOUT_S - CPU_WAIT_CHECK_S)
    assert pulse.is_late(STARTUP_TIMEOUT_S - CPU_WAIT_CHECK_S + 0.1)
    pulse.on_heartbeat(1.0)
    assert not pulse.is_late(1.0 + HEARTBEAT_TIMEOUT_S - CPU_WAIT_CHECK_S)
    assert pulse.is_late(1.1 + HEARTBEAT_TIMEOUT_S - CPU_WAIT_CHECK_S)
    pulse.extend_by(1.0)
    assert pulse.is_late(1.1 + HEARTBEAT_TIMEOUT_S - CPU_WAIT_CHECK_S)
    pulse.extend_to(4.0)
    assert not pulse.is_late(4.1)
