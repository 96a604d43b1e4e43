"""The world in both engines: rejected spawns, moved bodies, and reported states and contacts."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from models.world import Box, WorldDescription
from services.runtime.errors import BadInput
from services.sim.engines import Engine
from services.sim.physics.world import Body, BodyState, Contact, World
from tests.services.sim.physics.driven_robot import (
    STEP_NS,
    NewWorld,
    Spawner,
    drive_robots,
    placement_at,
    robot_body,
    yaw_of,
)

BOX = Box(name="crate", size=(0.4, 0.4, 0.4), position=(1.0, 0.0, 0.2))


def test_it_is_a_world(world: World) -> None:
    seam: World = world
    assert seam.step_ns == STEP_NS
    assert seam.names == ()


@pytest.mark.parametrize(
    ("at", "what"),
    [
        (placement_at(0.05, 0.0), r"'first' by 0\.0\d\d m"),
        (placement_at(1.0, 0.0), r"crate by 0\.\d+ m"),
        (placement_at(3.0, 3.0, z=-0.05), r"the ground by 0\.05\d m"),
    ],
)
def test_a_spawn_that_overlaps_is_refused_with_what_and_how_far(at: object, what: str, new_world: NewWorld) -> None:
    with new_world(WorldDescription(boxes=(BOX,))) as world:
        world.spawn(robot_body("first", "burger", placement_at(0.0, 0.0)))
        with pytest.raises(BadInput, match=rf"'second' at x .* would overlap with {what}"):
            world.spawn(robot_body("second", "burger", at))  # type: ignore[arg-type]
        assert world.names == ("first",)
        world.step()
        assert abs(world.body("first").state().position[2]) < 1e-4
        world.spawn(robot_body("second", "burger", placement_at(0.0, 0.3)))


def test_overlap_is_judged_where_the_others_are_now(spawn: Spawner, world: World) -> None:
    robot = spawn()
    drive_robots([robot], 0.22, 0.0, 3.0)
    world.spawn(robot_body("behind", "burger", placement_at(0.0, 0.0)))
    with pytest.raises(BadInput, match="'robot'"):
        world.spawn(robot_body("on top", "burger", placement_at(0.6, 0.0)))


def test_names_are_taken_once_and_wrong_ones_name_the_right_ones(spawn: Spawner, world: World) -> None:
    spawn("tb3_0")
    with pytest.raises(BadInput, match="already in the world"):
        world.spawn(robot_body("tb3_0", "burger", placement_at(2.0, 0.0)))
    with pytest.raises(BadInput, match="did you mean 'tb3_0'"):
        world.body("tb3_O").state()
    with pytest.raises(BadInput, match=r"unknown link 'base_scna'.*did you mean 'base_scan'"):
        world.body("tb3_0").link_pose("base_scna")


def test_a_broken_urdf_is_bad_input_and_changes_nothing(world: World, tmp_path: Path) -> None:
    broken = tmp_path / "robot.urdf"
    broken.write_text("<robot name='x'><link")
    with pytest.raises(BadInput, match="cannot load this URDF"):
        world.spawn(Body("x", broken))
    assert world.names == ()
    world.spawn(robot_body("x", "burger", placement_at(0.0, 0.0)))


def test_an_unknown_motor_joint_is_refused_and_the_name_stays_free(world: World) -> None:
    good = robot_body("x", "burger", placement_at(0.0, 0.0))
    wrong = Body("x", good.urdf, motors=(good.motors[0].__class__("wheel_lift_joint", 1.0),))
    with pytest.raises(BadInput, match="did you mean 'wheel_left_joint'"):
        world.spawn(wrong)
    world.spawn(good)


def test_set_state_moves_and_refuses_to_overlap(spawn: Spawner, world: World) -> None:
    spawn("a")
    spawn("b", at=placement_at(1.0, 0.0))
    target = BodyState(*placement_at(2.0, 1.0, 0.5), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    world.set_state("a", target)
    assert world.body("a").state().position == pytest.approx((2.0, 1.0, 0.0))
    assert yaw_of(world.body("a").state()) == pytest.approx(0.5)
    with pytest.raises(BadInput, match="'b'"):
        world.set_state("a", target._replace(position=(1.05, 0.0, 0.0)))
    assert world.body("a").state().position == pytest.approx((2.0, 1.0, 0.0))


def test_joint_readings_follow_the_wheels(spawn: Spawner, world: World) -> None:
    robot = spawn()
    drive_robots([robot], 0.2, 0.0, 2.0)
    assert world.body("robot").joints == ("wheel_left_joint", "wheel_right_joint")
    readings = world.body("robot").joint_readings()
    assert readings.velocity == pytest.approx((0.2 / 0.033,) * 2, rel=0.003)
    assert readings.position[0] * 0.033 == pytest.approx(world.body("robot").state().position[0], rel=0.003)


def test_contacts_name_the_pairs_and_leave_out_the_ground(new_world: NewWorld) -> None:
    with new_world(WorldDescription(boxes=(BOX,))) as world:
        for name, x in (("tb3_1", 0.0), ("tb3_0", -0.4)):
            world.spawn(robot_body(name, "burger", placement_at(x, 0.0)))
        world.step()
        assert world.contacts() == ()
        for name in world.names:
            world.body(name).set_speeds((6.0, 6.0))
        seen: set[Contact] = set()
        for _ in range(1500):
            world.step()
            seen |= set(world.contacts())
        assert seen == {Contact("tb3_0", "tb3_1"), Contact("tb3_1", "crate")}
        assert all(abs(world.body(name).state().position[2]) < 0.01 for name in world.names), "nobody climbs"
        assert world.body("tb3_1").state().position[0] < 0.8, "the crate holds"


@pytest.mark.parametrize(("model", "width"), [("burger", 0.178), ("waffle", 0.305)])
def test_side_by_side_robots_touch_at_their_wheels_not_at_the_spheres_inside(
    spawn: Spawner, world: World, model: str, width: float
) -> None:
    spawn("right", model)
    with pytest.raises(BadInput, match=r"by 0\.00\d m"):
        spawn("left", model, at=placement_at(0.0, width - 0.005))
    spawn("left", model, at=placement_at(0.0, width + 0.005))
    before = world.body("left").state().position
    for _ in range(100):
        world.step()
    assert world.contacts() == ()
    assert world.body("left").state().position == pytest.approx(before, abs=1e-4)


def test_link_placement_is_where_the_urdf_puts_it(spawn: Spawner, world: World) -> None:
    spawn(at=placement_at(1.0, 2.0, math.pi / 2))
    assert world.body("robot").link_pose("base_scan").position == pytest.approx((1.0, 2.0 - 0.032, 0.182), abs=1e-4)
    assert world.body("robot").link_pose("base_footprint").position == world.body("robot").state().position


def test_standard_output_stays_clean(engine: Engine) -> None:
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from models import urdf_path\n"
        "from models.world import WorldDescription\n"
        "from services.sim.engines import open_world\n"
        "from services.sim.physics.world import Body\n"
        f"with open_world({engine!r}, WorldDescription(), 5_000_000) as world:\n"
        "    world.spawn(Body('a', urdf_path('burger')))\n"
        "    world.step()\n"
        "    try:\n"
        "        world.spawn(Body('b', Path('missing.urdf')))\n"
        "    except ValueError as error:\n"
        "        print(type(error).__name__)\n"
        "        print(error, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout == "BadInput\n"
    assert "missing.urdf" in done.stderr
