"""An arm in a recording: its joint turns, its controller's state is plotted, and no plot of driving includes it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from messages.control import JointControllerState
from messages.sensor import JointState
from messages.std import Header, Time
from messages.topics import CONTROL_STATE, GROUND_TRUTH, JOINT_STATES
from services.logger import SERVICE, LoggerParameters
from services.runtime.testing import run_service
from tests.services.logger.recording_reader import entities, poses, table
from tests.services.logger.synthetic_drive import SyntheticRobot

TICKS = 200


def wanted(tick: int) -> float:
    return 30.0 * math.sin(tick / 30.0)


def test_its_exercise_is_recorded_beside_a_robot_that_drives(tmp_path: Path) -> None:
    file, robot = tmp_path / "run.rrd", SyntheticRobot(y0=0.0)
    params = LoggerParameters(
        robots=("arm", "tb3_0"),
        models=("arm", "burger"),
        states=(CONTROL_STATE.name, ""),
        file=str(file),
        serve=False,
        view="never",
        window=0.02,
    )
    with run_service(SERVICE, "/", params) as bench:
        bench.set_time(0.0)
        for tick in range(TICKS):
            header = Header(stamp=Time.of(tick * 10_000_000))
            angle = math.radians(wanted(tick) - 1.0)
            joints = JointState(header=header, name=("bear_link",), position=(angle,), velocity=(0.0,), effort=(0.0,))
            told = JointControllerState(
                header=header, set_point=wanted(tick), process_value=wanted(tick) - 1.0, error=1.0, command=0.1 * tick
            )
            bench.publish(JOINT_STATES.of("arm"), joints)
            bench.publish(CONTROL_STATE, told)
            if tick % 2 == 0:
                robot.step()
                bench.publish(GROUND_TRUTH.of("tb3_0"), robot.truth())
            if tick % 20 == 0:
                bench.set_time(tick / 100)
        bench.set_time(TICKS / 100)
    times, angles = table(file, "/plots/angle/arm")
    assert times.tolist() == [10_000_000 * tick for tick in range(TICKS)]
    assert np.allclose(angles[:, 0], [wanted(tick) for tick in range(TICKS)])
    assert np.allclose(angles[:, 0] - angles[:, 1], 1.0)
    assert np.allclose(table(file, "/plots/error/arm")[1], 1.0)
    assert np.allclose(table(file, "/plots/effort/arm")[1][:, 0], 0.1 * np.arange(TICKS))
    _, turned = poses(file, "arm", "bear_link")
    assert len(turned) == TICKS
    assert len(np.unique(np.round(turned[:, 3:], 6), axis=0)) > TICKS / 2, "the joint turns"
    assert table(file, "/plots/speed")[1].shape[1] == 1, "the robot that drives, alone"
    assert not any(each.startswith("/arm/marker") and not each.endswith("/name") for each in entities(file))
