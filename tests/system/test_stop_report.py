"""A controller that stops commanding, in real time: the grader's stop measurement agrees with theory."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from deploy.report.write import read_measurements
from messages.geometry import Twist
from messages.topics import BASE_STATUS, CMD_VEL
from models.dynamics import predict_stop
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, speed, time_of
from tests.harness.processes import Network, parameter_options
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits

TIMEOUT, BRAKE, SPEED = 0.25, 1.5, 0.5
FACTOR = 0.2
"""Seconds of simulation per second of wall time: a command of this test may be 1.25 s of wall time late."""


def test_a_stop_is_measured_within_five_per_cent_of_the_theory(tmp_path: Path) -> None:
    robots = [{"name": "p3dx", "model": "p3dx", "parameters": {"cmd_vel_timeout": TIMEOUT}}]
    halting = [{"name": "p3dx", "timeout": TIMEOUT, "brake": BRAKE}]
    with Network(tmp_path) as network, network.node() as node:
        network.start("sim", *parameter_options({"robots": robots, "mode": "real", "factor": FACTOR}))
        settings = {"robots": ["p3dx"], "halting": halting, "ends": "never", "output": str(tmp_path)}
        grader = network.start("grader", *parameter_options(settings))
        truth = GroundTruthRecorder(node, "p3dx")
        base = MessageRecorder(node.subscribe(BASE_STATUS, "/p3dx/base_status"))
        commands = node.advertise(CMD_VEL, "/p3dx/cmd_vel")

        def cruising() -> bool:
            commands.publish(Twist.planar(SPEED, 0.0))
            return speed(truth.wait_next()) > 0.999 * SPEED

        wait_until(truth.received, 30.0, "ground truth")
        wait_until(cruising, WITHIN_S, "its speed")
        begun = time_of(truth.received()[-1])
        wait_until(lambda: cruising() and time_of(truth.received()[-1]) > begun + 0.5, WITHIN_S, "a while at its speed")
        wait_until(lambda: base.wait_next().timed_out and abs(speed(truth.received()[-1])) < 1e-3, WITHIN_S, "rest")
        truth.wait_after(0.4)
        timed_out = base.received()[-1].commands_timed_out
        grader.signal(signal.SIGINT)
        assert grader.wait() == 0, grader.text
    figures, theory = read_measurements(tmp_path).robots["p3dx"], predict_stop(SPEED, TIMEOUT, BRAKE)
    # More than one if this process stood still while it drove.
    assert 1 <= figures.stops <= figures.commands_timed_out == timed_out
    assert figures.stop_speed == pytest.approx(SPEED, rel=0.01)
    assert figures.stop_distance_theory_m == pytest.approx(theory.distance, rel=0.02)
    assert figures.stop_distance_m == pytest.approx(theory.distance, rel=0.05)
    assert figures.stop_time_s == pytest.approx(theory.time, rel=0.05)
