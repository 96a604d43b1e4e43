"""Odometry messages."""

from __future__ import annotations

import math

import numpy as np
import pytest

from messages.std import Header, Time
from services.sim.drive.odometry import (
    PLANAR_COVARIANCE,
    ZERO_COVARIANCE,
    counted_motion,
    initial_odometry,
    odometry_message,
    world_motions,
)
from services.sim.physics.world import BodyState
from services.sim.snapshot import FEW


def test_the_twist_of_the_world_is_turned_into_the_body() -> None:
    half = math.pi / 4
    state = BodyState((1.0, 2.0, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)), (0.0, 0.5, 0.0), (0.0, 0.0, 0.3))
    header = Header(stamp=Time.of(123), frame_id="world")
    odometry = odometry_message(
        header,
        "tb3_0/base_footprint",
        world_motions(np.array([state.numbers]))[0].tolist(),
        ZERO_COVARIANCE,
        ZERO_COVARIANCE,
    )
    twist = odometry.twist.twist
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == pytest.approx((0.5, 0.0, 0.0), abs=1e-12)
    assert twist.angular.z == pytest.approx(0.3)
    assert odometry.pose.pose.orientation.yaw == pytest.approx(math.pi / 2)
    assert (odometry.header, odometry.child_frame_id) == (header, "tb3_0/base_footprint")
    assert odometry.pose.packed == odometry.twist.packed == ZERO_COVARIANCE


def test_many_bases_have_the_motions_of_each() -> None:
    states = np.random.default_rng(3).normal(size=(FEW + 3, 13))
    together = world_motions(states)
    assert together.tolist() == [world_motions(states[row : row + 1])[0].tolist() for row in range(len(states))]
    assert world_motions(states[:FEW]).tolist() == together[:FEW].tolist()
    assert world_motions(states[:0]).shape == (0, 13)


def test_the_covariance_is_the_plugin_s() -> None:
    motion = counted_motion(initial_odometry(0.0, 0.0, 1.0, 2.0, 4.0))
    odometry = odometry_message(Header(), "base", motion, PLANAR_COVARIANCE, ZERO_COVARIANCE)
    assert odometry.pose.covariance[::7] == (1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3)
    assert odometry.pose.packed == PLANAR_COVARIANCE
    assert odometry.pose.pose.position.x == 1.0
    assert odometry.pose.pose.orientation.yaw == pytest.approx(4.0 - math.tau)
