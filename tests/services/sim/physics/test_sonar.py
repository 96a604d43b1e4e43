"""Sonars in both engines compared with computed distances, and the simulation's messages of them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from messages.sensor import PointCloud, Range
from messages.std import Header
from messages.topics import RANGE, SCAN, SONAR, TF_STATIC
from models.model import read_model
from models.world import Box, WorldDescription, read_world
from services.runtime.transport.memory import MemoryBus
from services.sim.noise import NoiseSource
from services.sim.parameters import BaseParameters, RobotEntry
from services.sim.sensors import (
    Floats,
    SonarRing,
    cone_rays,
    range_messages,
    sonar_cloud,
    sonar_ranges,
    sonar_ring,
)
from services.sim.simulation import Simulation
from tests.harness.memory_node import memory_node
from tests.services.sim.physics.driven_robot import NewWorld, placement_at, robot_body

pytestmark = pytest.mark.slow

FIGURES = read_model("p3dx").sonar
assert FIGURES is not None
RING: SonarRing = sonar_ring("p3dx", FIGURES)
HEIGHT, HALF = 0.2115, math.radians(15)
BETWEEN = 1.0015
"""Tolerance: a surface's nearest point is up to 3 degrees from a ray, 1 / cos(3 deg)."""


def heard(new_world: NewWorld, *boxes: Box, yaw: float = 0.0, x: float = 0.0, y: float = 0.0) -> Floats:
    with new_world(WorldDescription(boxes=boxes)) as world:
        world.spawn(robot_body("robot", "p3dx", placement_at(x, y, yaw)))
        world.step()
        return sonar_ranges(world, "robot", RING)


def wall(height: float = 1.0) -> Box:
    """Return a wall whose face is the plane x = 2 m."""
    return Box(name="wall", size=(0.2, 40.0, height), position=(2.1, 0.0, height / 2))


def to_the_wall(yaw: float, half: float = HALF) -> Floats:
    """Return the distances to the plane x = 2 m along each cone's ray nearest to its normal."""
    c, s = math.cos(yaw), math.sin(yaw)
    ahead = 2.0 - (RING.positions[:, 0] * c - RING.positions[:, 1] * s)
    headings = yaw + np.arctan2(RING.axes[:, 1], RING.axes[:, 0])
    off = np.abs((headings + np.pi) % (2 * np.pi) - np.pi)
    nearest = np.maximum(off - half, 0.0)
    distances = np.where(nearest < np.pi / 2 - 0.01, ahead / np.cos(nearest), np.inf)
    return np.where((distances > 0) & (distances <= 5.0), distances, np.inf)


@pytest.mark.parametrize("yaw", [0.0, 0.3, -1.0, math.pi / 2, 2.5, math.pi])
def test_a_wall_is_heard_where_it_is_nearest_in_the_cone(yaw: float, new_world: NewWorld) -> None:
    expected, found = to_the_wall(yaw), heard(new_world, wall(), yaw=yaw)
    sure = np.isfinite(expected) & (expected < 4.9)
    assert sure.sum() >= 4
    assert (found[sure] >= expected[sure] - 1e-4).all()
    assert (found[sure] <= expected[sure] * BETWEEN + 0.02 * (expected[sure] > 2.5)).all()
    assert np.isinf(found[np.isinf(expected)]).all()


def test_nothing_is_heard_of_the_ground_and_of_the_robot_itself(new_world: NewWorld) -> None:
    for yaw in (0.0, 1.0, -2.0):
        assert (heard(new_world, yaw=yaw) == np.inf).all()


def test_what_is_lower_than_the_sonars_is_heard_once_the_cone_has_come_down_to_it(new_world: NewWorld) -> None:
    """A cone's lower edge reaches a height of 0.10 m at a distance of 0.1115 m / tan(15 deg)."""
    near = (HEIGHT - 0.10) / math.tan(HALF)
    low = Box(name="low", size=(0.2, 2.0, 0.10), position=(1.1, 0.0, 0.05))
    far = heard(new_world, low, x=1.0 - 0.166 - near - 0.1)
    assert far[3:5] == pytest.approx([(near + 0.1) / math.cos(HALF)] * 2, rel=0.02)
    above = heard(new_world, low, x=1.0 - 0.166 - near + 0.15)
    assert above[3:5] == pytest.approx([(HEIGHT - 0.10) / math.sin(HALF)] * 2, rel=0.02), "its top, not its front"
    assert (heard(new_world, low, x=1.0 - 0.166 - near + 0.35)[3:5] == np.inf).all(), "all of it lies below the cone"


def test_each_sonar_hears_the_post_before_it_and_no_other(new_world: NewWorld) -> None:
    for number in range(16):
        heading = math.atan2(RING.axes[number, 1], RING.axes[number, 0])
        x, y = RING.positions[number, :2] + 1.5 * RING.axes[number, :2]
        post = Box(name="post", size=(0.1, 0.1, 1.0), position=(float(x), float(y), 0.5), yaw=heading)
        found = heard(new_world, post)
        assert found[number] == pytest.approx(1.45, abs=2e-3)
        off = [abs(math.remainder(heading - other, math.tau)) for other in np.arctan2(RING.axes[:, 1], RING.axes[:, 0])]
        assert all(math.isinf(found[other]) for other in range(16) if off[other] > math.radians(60)), number


def test_the_boxes_of_the_arena_from_its_middle(new_world: NewWorld) -> None:
    """The robot faces the north wall, at y = 4 m, with the green box ahead on the left and the blue one behind."""
    with new_world(read_world("arena")) as world:
        world.spawn(robot_body("robot", "p3dx", placement_at(0.0, 0.0, math.pi / 2)))
        world.step()
        found = sonar_ranges(world, "robot", RING)
    assert found[3:5] == pytest.approx([4.0 - 0.166] * 2, rel=2e-3)
    assert found[12] == pytest.approx(4.0 - 0.255, rel=2e-3)
    assert found[1] == pytest.approx(math.hypot(1.7 - 0.119, 0.85 - 0.114), rel=0.01), "a corner of the green box"
    blue = 2.5 - 0.15 * math.sqrt(2)
    assert found[11] == pytest.approx(math.hypot(1.0 - 0.027, blue - 0.255), rel=0.01), "a corner of the blue box"


def test_too_near_and_too_far(new_world: NewWorld) -> None:
    """Sonar 3 is 0.166 m ahead of the axle; at 0.06 m from the wall its reading is -inf."""
    assert heard(new_world, wall(), x=2.0 - 0.166 - 0.06)[3] == -np.inf
    assert heard(new_world, wall(), x=2.0 - 0.166 - 0.12)[3] == pytest.approx(0.12, abs=2e-3)
    assert heard(new_world, wall(), x=2.0 - 0.166 - 4.9)[3] == pytest.approx(4.9, rel=2e-3)
    assert heard(new_world, wall(), x=2.0 - 0.166 - 5.1)[3] == np.inf


def test_a_cone_is_sampled_evenly() -> None:
    rays = cone_rays(2 * HALF)
    assert rays.shape == (37, 3)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(1.0)
    off = np.degrees(np.arccos(np.clip(rays[:, 0], -1, 1)))
    assert sorted({round(float(angle), 6) for angle in off}) == [0.0, 5.0, 10.0, 15.0]
    apart = np.degrees(np.arccos(np.clip(rays @ rays.T, -1, 1)))
    np.fill_diagonal(apart, np.inf)
    assert apart.min(axis=1) == pytest.approx(5.0, abs=0.2)


def test_noise_spares_what_is_not_heard_and_repeats(new_world: NewWorld) -> None:
    with new_world(WorldDescription(boxes=(wall(),))) as world:
        world.spawn(robot_body("robot", "p3dx", placement_at(0.0, 0.0)))
        clean = sonar_ranges(world, "robot", RING)
        noise = NoiseSource(1, "robot", "sonar", 20, 16)
        runs = [sonar_ranges(world, "robot", RING, noise.at(20 * reading)) for reading in range(200)]
        again = sonar_ranges(world, "robot", RING, noise.at(140))
    assert (again == runs[7]).all()
    errors = np.array([run[3] - clean[3] for run in runs])
    assert np.std(errors) == pytest.approx(RING.config.noise, rel=0.15)
    assert all((np.isinf(run) == np.isinf(clean)).all() for run in runs)


def test_readings_become_points_and_ranges() -> None:
    readings = np.full(16, np.inf)
    readings[3], readings[8] = 1.5, -np.inf
    points = sonar_cloud(RING, readings, Header(frame_id="p3dx/sonar_frame"))
    assert points.channels[0].name == "range"
    assert points.channels[0].values.tolist() == readings.tolist()
    place = points.points[3]
    heading = math.radians(10)
    assert (place.x, place.y, place.z) == pytest.approx(
        (0.166 + 1.5 * math.cos(heading), 0.027 + 1.5 * math.sin(heading), 0.0)
    )
    assert points.points[0].y == pytest.approx(0.136 + 5.0), "nothing heard: as far as it hears"
    assert points.points[8].y == pytest.approx(-0.136 - 0.1), "too near"
    single = range_messages(RING, readings, [Header(frame_id=f"p3dx/sonar_{number}") for number in range(16)])
    assert [each.range for each in single] == readings.tolist()
    assert [each.header.frame_id for each in single][3] == "p3dx/sonar_3"
    assert {(each.radiation_type, each.min_range, each.max_range) for each in single} == {(Range.ULTRASOUND, 0.1, 5.0)}
    assert single[0].field_of_view == pytest.approx(math.radians(30))


def test_nothing_is_measured_while_nobody_listens(monkeypatch: pytest.MonkeyPatch, new_world: NewWorld) -> None:
    bus, cast = MemoryBus(), []
    with (
        new_world(WorldDescription()) as world,
        memory_node(bus, "sim") as sim,
        memory_node(bus, "other") as other,
    ):
        rays = world.cast_rays
        monkeypatch.setattr(world, "cast_rays", lambda *ends: cast.append(len(ends[0])) or rays(*ends))
        simulation = Simulation(sim, world, 0)
        simulation.spawn(RobotEntry(name="robot", model="p3dx"), placement_at(0.0, 0.0))
        for listens in (False, True, False):
            cast.clear()
            heard_by = other.subscribe(RANGE, "/robot/sonar/range") if listens else None
            for _ in range(40):
                simulation.publish()
                simulation.step()
            assert cast == ([16 * 37] * 2 if listens else [])
            if heard_by is not None:
                other.unregister(heard_by)


def test_the_simulation_publishes_them_ten_times_a_second_to_who_listens(new_world: NewWorld) -> None:
    bus = MemoryBus()
    with (
        new_world(WorldDescription(boxes=(wall(),))) as world,
        memory_node(bus, "sim") as sim,
        memory_node(bus, "other") as other,
    ):
        simulation = Simulation(sim, world, 0)
        entry = RobotEntry(name="robot", model="p3dx", namespace="RosAria", parameters=BaseParameters(noise=False))
        simulation.spawn(entry, placement_at(0.0, 0.0))
        fixed = other.subscribe(TF_STATIC)
        clouds, singles, scans = (other.subscribe(each, f"/RosAria/{each.name}") for each in (SONAR, RANGE, SCAN))
        for _ in range(101):
            simulation.publish()
            simulation.step()
        for each in (clouds, singles, scans, fixed):
            each.update()
        readings = sonar_ranges(world, "robot", RING)
        seen = [message for message, _ in clouds.messages]
        assert len(seen) == 6
        assert all(isinstance(each, PointCloud) for each in seen)
        stamps = [each.header.stamp.ns for each in seen]
        assert {later - earlier for earlier, later in pairwise(stamps)} == {100_000_000}
        assert seen[-1].header.frame_id == "robot/sonar_frame"
        assert seen[-1].channels[0].values.tolist() == pytest.approx(readings.tolist(), abs=1e-4)
        ranges = [message for message, _ in singles.messages]
        assert len(ranges) == 6 * 16
        assert [each.header.frame_id for each in ranges[:16]] == [f"robot/sonar_{number}" for number in range(16)]
        assert [each.range for each in ranges[-16:]] == pytest.approx(readings.tolist(), abs=1e-4)
        assert len(scans.messages) == 6
        frames = {each.child_frame_id: each for each in fixed.messages[-1][0].transforms}
        assert {f"robot/sonar_{number}" for number in range(16)} | {"robot/laser", "robot/sonar_frame"} <= frames.keys()
        assert frames["robot/sonar_0"].header.frame_id == "robot/sonar_frame"
