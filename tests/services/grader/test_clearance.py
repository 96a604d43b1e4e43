"""The clearance between robots and bodies of the world: computed by hand, and compared with laser ranges."""

from __future__ import annotations

import math

import numpy as np
import pytest

from messages.geometry import Point, Pose, Quaternion, Vector3
from messages.se3 import Pose3, quaternion_from_rpy
from messages.std import ColorRGBA, Header
from messages.visualization import Marker, MarkerArray
from models import urdf_path
from models.extents import vertical_extent
from models.model import read_model
from models.world import read_world
from services.grader import SizeSpec
from services.grader.clearance import ClearanceMeter
from services.grader.results import world_arrays
from services.markers.world_bodies import World, world_bodies
from services.runtime.step import STEP_NS
from services.sim.engines import default_engine, open_world
from services.sim.physics.world import Body
from services.sim.sensors import laser_ranges, laser_scan
from services.sim.world_markers import world_markers

SECOND = 10**9
SIZE = SizeSpec(name="a", radius=0.1, bottom=0.0, top=0.2)


def marker(
    name: str, kind: str, x: float, y: float, z: float = 0.5, shape: int = Marker.CUBE, size: float = 1.0
) -> Marker:
    return Marker(
        ns=kind,
        text=name,
        type=shape,
        pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion.from_yaw(math.pi / 4)),
        scale=Vector3(x=1.0, y=1.0, z=1.0),
        color=ColorRGBA(r=0.5, g=0.25, b=0.0, a=1.0),
    )


def world_of(*markers: Marker) -> World:
    return [(body, body.footprints()) for body in world_bodies(MarkerArray(markers=markers))]


def test_the_least_clearance_is_told_with_its_time_and_body() -> None:
    meter = ClearanceMeter({"a": SIZE})
    meter.add_position(0, "a", (0.0, 0.0, 0.0))  # before the world is known
    meter.set_world(world_of(marker("ball", "fixed", 2, 0, shape=Marker.SPHERE), marker("box", "fixed", 0, 3)))
    for step in range(1, 5):
        meter.add_position(step * SECOND, "a", (0.25 * step, 0.0, 0.0))
        meter.add_position(step * SECOND, "unknown", (2.0, 0.0, 0.0))
        meter.update()
    meter.add_position(5 * SECOND, "a", (0.0, 0.0, 0.0))
    meter.update(final=True)
    assert set(meter.least) == {"a"}
    assert meter.least["a"] == (pytest.approx(0.4), 4.0, "ball")
    meter.add_position(6 * SECOND, "a", (0.0, 3.0, 0.0))
    meter.update()
    assert meter.least["a"] == (pytest.approx(-0.6), 6.0, "box"), "within the box: half of its side, and the radius"


def test_what_lies_above_it_and_what_it_drives_over_does_not_count() -> None:
    table, mat = marker("table", "fixed", 0, 0, z=0.75), marker("mat", "fixed", 0, 0, z=-0.49)
    ramp, ground = marker("ramp", "ground", 0, 0), marker("ground", "ground", 0, 0)
    meter = ClearanceMeter({"a": SIZE, "tall": SizeSpec(name="tall", radius=0.1, top=0.3)})
    meter.set_world(world_of(table, mat, ramp, ground))
    for robot in ("a", "tall"):
        meter.add_position(0, robot, (0.0, 2.0, 0.0))
    meter.update()
    assert list(meter.least) == ["tall"]
    meter.add_position(1, "a", (0.0, 2.0, 0.1))
    meter.update()
    assert meter.least["a"].distance == pytest.approx(2 - math.sqrt(0.5) - 0.1), "raised by 10 cm, it reaches the table"


def test_a_body_that_moves_is_where_it_was_at_the_time_of_the_sample() -> None:
    """The robot stands still; a ball passes it between two samples, in either order of the messages."""
    found = []
    for states_first in (True, False):
        meter = ClearanceMeter({"a": SIZE})
        meter.set_world(world_of(marker("ball", "moving", -2, 0.7, shape=Marker.SPHERE)))
        states = [(t * SECOND // 10, {"ball": Pose3((-2.05 + 0.1 * t, 0.7, 0.5))}) for t in range(60)]
        samples = [t * SECOND // 20 for t in range(1, 110)]
        for number in range(120):
            if states_first and number < len(states):
                meter.add_states(*states[number])
            if number < len(samples):
                meter.add_position(samples[number], "a", (0.0, 0.0, 0.0))
            if not states_first and number % 2 == 0 and number // 2 < len(states):
                meter.add_states(*states[number // 2])
            if not states_first:
                meter.update()
        meter.update(final=True)
        found.append(meter.least["a"])
        # At 2.05 s, halfway between two samples, it is beside the robot.
        assert meter.least["a"].at == pytest.approx(2.05)
        assert meter.least["a"].distance == pytest.approx(0.7 - 0.5 - 0.1)
        assert len(meter.paths["ball"]) > 30
    assert found[0] == found[1]


def test_a_pushed_box_that_tips_over_covers_what_it_lies_on() -> None:
    plank = Marker(
        ns="movable",
        text="plank",
        type=Marker.CUBE,
        pose=Pose(position=Point(z=1.0)),
        scale=Vector3(x=0.2, y=0.2, z=2.0),
    )
    meter = ClearanceMeter({"a": SIZE})
    meter.set_world(world_of(plank))
    lying = Pose3((1.0, 0.0, 0.1), quaternion_from_rpy(0, math.pi / 2, 0))
    for second, pose in enumerate((Pose3((0.0, 0.0, 1.0)), lying)):
        meter.add_states(second * SECOND, {"plank": pose})
        meter.add_position(second * SECOND, "a", (2.5, 0.0, 0.0))
        meter.update()
        assert meter.least["a"].distance == pytest.approx(2.3 if second == 0 else 0.4)


def test_the_outlines_and_ways_are_kept_for_the_picture() -> None:
    world = world_of(marker("box", "fixed", 0, 0), marker("ball", "moving", 5, 5, shape=Marker.SPHERE))
    arrays = world_arrays(world, {"ball": [(5.0, 5.0), (6.0, 5.0)]})
    assert arrays["world.counts"].tolist() == [4, 48]
    assert arrays["world.bodies"].tolist() == [0, 1]
    assert arrays["world.corners"].shape == (52, 2)
    assert arrays["world.colours"].tolist() == [[0.5, 0.25, 0.0, 1.0]] * 2
    assert arrays["world.path_counts"].tolist() == [0, 2]
    assert world_arrays((), {})["world.corners"].shape == (0, 2)


@pytest.mark.parametrize("model", ["burger", "waffle"])
def test_the_clearance_is_what_the_laser_sees_of_the_nearest_wall(model: str) -> None:
    """In the arena, at places where a wall, an edge or a corner is nearest to the middle of the robot."""
    arena, figures = read_world("arena"), read_model(model)
    assert figures.laser is not None
    bottom, top = vertical_extent(model)
    world = [(body, body.footprints()) for body in world_bodies(world_markers(arena))]
    with open_world(default_engine(), arena, STEP_NS) as physics:
        for number, (x, y, yaw) in enumerate([(3.5, 0.3, 0.2), (-3.4, 3.2, 2.0), (2.0, 1.2, -1.0), (1.45, -2.6, 0.4)]):
            name = f"robot{number}"
            handle = physics.spawn(Body(name=name, urdf=urdf_path(model), pose=Pose3.planar(x, y, yaw)))
            scan = laser_scan(figures.laser, laser_ranges(physics, [name], figures.laser, [None])[0], Header())
            turn = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
            ranges = scan.ranges.numpy().astype(float)
            seen = np.isfinite(ranges)
            eye = handle.link_pose(figures.laser.link)
            heading = turn[seen] + eye.rpy[2]
            echoes = np.column_stack((np.cos(heading), np.sin(heading))) * ranges[seen, None] + eye.position[:2]
            by_laser = np.hypot(*(echoes - (x, y)).T).min() - figures.radius
            meter = ClearanceMeter({name: SizeSpec(name=name, radius=figures.radius, bottom=bottom, top=top)})
            meter.set_world(world)
            meter.add_position(0, name, handle.state().position)
            meter.update()
            assert meter.least[name].distance == pytest.approx(by_laser, abs=0.004), (x, y)
            assert meter.least[name].distance <= by_laser + 1e-4
            physics.delete(name)
