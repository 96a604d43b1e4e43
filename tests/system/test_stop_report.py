"""A controller that stops commanding, in real time: the grader's stop measurement agrees with theory."""

from __future__ import annotations

import json
import signal
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from deploy.report.write import read_measurements
from messages.geometry import Twist
from messages.topics import BASE_STATUS, CMD_VEL
from models.dynamics import predict_stop
from services.grader.records import RobotFigures
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, speed, time_of
from tests.harness.processes import Network
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits

TIMEOUT, BRAKE, SPEED = 0.25, 1.5, 0.5
TRIES, LATE_S = 5, TIMEOUT / 2
"""A try in which this test sent a command so late [s of wall time] says nothing about the base or the grader."""


def test_a_stop_is_measured_within_five_per_cent_of_the_theory(tmp_path: Path) -> None:
    robots = [{"name": "p3dx", "model": "p3dx", "parameters": {"cmd_vel_timeout": TIMEOUT}}]
    with Network(tmp_path) as network:
        network.start("sim", "--param", f"robots={json.dumps(robots)}", "--param", "mode=real")
        tries = (measured_stop(network, tmp_path / str(number)) for number in range(TRIES))
        stop = next((each for each in tries if each.longest_gap_s < LATE_S), None)
    assert stop is not None, f"a command of this test was late in each of {TRIES} tries"
    theory, figures = predict_stop(SPEED, TIMEOUT, BRAKE), stop.figures
    assert (figures.stops, figures.commands_timed_out) == (1, stop.timed_out_before + 1)
    assert figures.stop_speed == pytest.approx(SPEED, rel=0.01)
    assert figures.stop_distance_theory_m == pytest.approx(theory.distance, rel=0.02)
    assert figures.stop_distance_m == pytest.approx(theory.distance, rel=0.05)
    assert figures.stop_time_s == pytest.approx(theory.time, rel=0.05)


class MeasuredStop(NamedTuple):
    """The grader's figures, the base's time-outs before, and the longest gap between two commands [s of wall time]."""

    figures: RobotFigures
    timed_out_before: int
    longest_gap_s: float


def measured_stop(network: Network, folder: Path) -> MeasuredStop:
    """Drive, then send no more commands, and measure how the base stops."""
    folder.mkdir()
    halting = [{"name": "p3dx", "timeout": TIMEOUT, "brake": BRAKE}]
    settings = {"robots": ["p3dx"], "halting": halting, "ends": "never", "output": str(folder)}
    words = [word for key, value in settings.items() for word in ("--param", f"{key}={json.dumps(value)}")]
    grader = network.start("grader", *words)
    with network.node() as node:
        truth, base = (
            GroundTruthRecorder(node, "p3dx"),
            MessageRecorder(node.subscribe(BASE_STATUS, "/p3dx/base_status")),
        )
        commands = node.advertise(CMD_VEL, "/p3dx/cmd_vel")

        sent: list[float] = []

        def cruising() -> bool:
            commands.publish(Twist.planar(SPEED, 0.0))
            sent.append(time.monotonic())
            return speed(truth.wait_next()) > 0.999 * SPEED

        wait_until(truth.received, 30.0, "ground truth")
        timed_out_before = base.wait_next().commands_timed_out
        wait_until(cruising, WITHIN_S, "its speed")
        begun = time_of(truth.received()[-1])
        wait_until(lambda: cruising() and time_of(truth.received()[-1]) > begun + 0.5, WITHIN_S, "a while at its speed")
        wait_until(lambda: base.wait_next().timed_out and abs(speed(truth.received()[-1])) < 1e-3, WITHIN_S, "rest")
        truth.wait_after(1.0)
        grader.signal(signal.SIGINT)
        assert grader.wait() == 0, grader.text
    longest_gap_s = max(later - earlier for earlier, later in pairwise(sent))
    return MeasuredStop(read_measurements(folder).robots["p3dx"], timed_out_before, longest_gap_s)
