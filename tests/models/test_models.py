"""Every model of the repository is loaded by real PyBullet and by rerun's strict parser, and shaken for a second."""

from __future__ import annotations

import math
import random
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest
from rerun.urdf import UrdfTree

import models
from models import MODELS, WHEELED, WORLDS, UnknownModel, model_config_path, urdf_path, world_path
from models.extents import vertical_extent
from models.model import LaserConfig, read_model
from models.robot_source import resolve_robot
from models.urdf import read_joints, read_robot
from models.world import WorldDescription, read_world
from services.sim.engines import default_engine, open_world
from services.sim.physics.world import Body, Motor
from tests.models import sample_robots as samples

MASSES = {"burger": 1.0, "waffle": 1.55, "waffle_pi": 1.55, "p3dx": 9.0, "arm": 52.0, "arm_corrected": 52.0}
"""Masses [kg]: sums of the TurtleBots' and the arm's published URDFs, and the Pioneer's published weight."""

SOURCES = dict.fromkeys(WHEELED, "ROBOTIS") | {"p3dx": "Pioneer3dx.proto"}
SOURCES |= {"arm": "one_dof_arm", "arm_corrected": "../arm/README.md"}
"""Sources that a model's README must name."""


def test_the_lists_are_what_lies_in_the_folders() -> None:
    here = Path(models.__file__).parent
    assert set(MODELS) == {each.parent.name for each in here.glob("*/robot.urdf")}
    assert set(WORLDS) == {each.stem for each in (here / "worlds").glob("*.toml")}


def test_a_wrong_name_gets_the_nearest_right_one() -> None:
    with pytest.raises(UnknownModel, match=r"unknown model 'buger'; did you mean 'burger'\? \(known: burger, waffle"):
        urdf_path("buger")
    with pytest.raises(UnknownModel, match=r"unknown model '\.\./x' \(known"):
        model_config_path("../x")
    with pytest.raises(UnknownModel, match="unknown world 'emty'; did you mean 'empty'"):
        world_path("emty")


@pytest.mark.parametrize("name", MODELS)
def test_every_link_has_a_mass_and_a_tensor_that_a_body_can_have(name: str) -> None:
    total = 0.0
    for link in ElementTree.parse(urdf_path(name)).getroot().findall("link"):
        inertial = link.find("inertial")
        assert inertial is not None, f"{link.get('name')} would weigh 1 kg in PyBullet"
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        assert mass is not None
        assert tensor is not None
        total += float(mass.attrib["value"])
        x, y, z = sorted(float(tensor.attrib[axis]) for axis in ("ixx", "iyy", "izz"))
        assert 0 < z <= x + y, link.get("name")
    assert total == pytest.approx(MASSES[name], rel=0.01)


@pytest.mark.parametrize("name", MODELS)
def test_every_movable_joint_has_a_velocity_limit(name: str) -> None:
    for joint in ElementTree.parse(urdf_path(name)).getroot().findall("joint"):
        if joint.get("type") != "fixed":
            limit = joint.find("limit")
            assert limit is not None
            # The arm has the tutorial's 0 on purpose.
            assert float(limit.attrib["velocity"]) > 0 or (name == "arm" and limit.attrib["velocity"] == "0")


@pytest.mark.parametrize("name", MODELS)
def test_rerun_parses_it(name: str) -> None:
    tree = UrdfTree.from_file_path(urdf_path(name), entity_path_prefix="robot")
    assert tree.name == name
    assert [joint.name for joint in tree.joints()] == [joint.name for joint in read_joints(name)]
    shown = {"arm": "end_link", "arm_corrected": "end_link"}.get(name, "base_link")
    link = tree.get_link_by_name(shown)
    assert link is not None
    assert len(tree.get_visual_geometry_paths(link)) > 5


@pytest.mark.parametrize("name", WHEELED)
def test_figures_and_urdf_agree(name: str) -> None:
    model, joints = read_model(name), {joint.name: joint for joint in read_joints(name)}
    links = {joint.child for joint in joints.values()}
    assert model.wheels is not None
    left, right = joints[model.wheels.left_joint], joints[model.wheels.right_joint]
    assert math.dist(left.xyz, right.xyz) == pytest.approx(model.wheels.separation)
    assert left.xyz[1] > 0 > right.xyz[1]
    assert left.axis == right.axis == (0.0, 1.0, 0.0)
    assert left.xyz[2] + joints["base_joint"].xyz[2] == pytest.approx(model.wheels.radius), "wheels touch the ground"
    for part in (model.laser, model.sonar, model.imu, model.camera):
        assert part is None or part.link in links
    if model.sonar is not None:
        assert len(set(model.sonar.links)) == len(model.sonar.links)
        assert {joint.child for joint in joints.values() if joint.parent == model.sonar.link} == set(model.sonar.links)


@pytest.mark.parametrize("name", MODELS)
def test_the_readme_gives_sources(name: str) -> None:
    text = urdf_path(name).with_name("README.md").read_text()
    assert "## Sources" in text
    assert SOURCES[name] in text


@pytest.mark.parametrize("name", WHEELED)
def test_shaken_for_a_second_it_stays_upright_and_whole(name: str) -> None:
    model = read_model(name)
    assert model.wheels is not None
    motors = tuple(Motor(joint, model.wheels.torque) for joint in (model.wheels.left_joint, model.wheels.right_joint))
    chance = random.Random(7)
    top = model.wheels.max_linear / model.wheels.radius
    with open_world(default_engine(), WorldDescription(), 5_000_000) as world:
        world.spawn(Body("robot", urdf_path(name), motors=motors))
        for step in range(200):
            if step % 20 == 0:
                world.body("robot").set_speeds([chance.uniform(-top, top) for _ in motors])
            world.step()
            state = world.body("robot").state()
            x, y, _, _ = state.orientation
            assert 2 * math.hypot(x, y) < 0.1, f"tilted at step {step}"
            assert abs(state.position[2]) < 0.01
        world.body("robot").set_speeds([0.0] * len(motors))
        for _ in range(200):
            world.step()
        state = world.body("robot").state()
        x, y, _, _ = state.orientation
        assert 2 * math.hypot(x, y) < 1e-3, "it stands level again"
        assert math.dist(state.linear, (0, 0, 0)) < 1e-4
        assert world.contacts() == ()


@pytest.mark.parametrize("name", WORLDS)
def test_every_world_can_be_entered(name: str) -> None:
    with open_world(default_engine(), read_world(name), 5_000_000) as world:
        world.spawn(Body("robot", urdf_path("burger")))
        world.step()


def test_a_joint_turns_its_child_as_urdf_says() -> None:
    optical = next(joint for joint in read_joints("waffle_pi") if joint.child == "camera_rgb_optical_frame")
    assert optical.rotation() == pytest.approx((-0.5, 0.5, -0.5, 0.5))
    wheel = next(joint for joint in read_joints("burger") if joint.name == "wheel_left_joint")
    assert wheel.rotation(math.pi / 2) == pytest.approx((0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_link_offsets_are_where_the_engine_has_the_links(name: str) -> None:
    with open_world(default_engine(), WorldDescription(), 5_000_000) as world:
        world.spawn(Body("robot", urdf_path(name)))
        for link in {joint.child for joint in read_joints(name)}:
            offset = read_robot(name).link_offset(link)
            assert offset == pytest.approx(world.body("robot").link_pose(link).position, abs=1e-6)


def test_a_ring_of_sonars_is_that_of_aria() -> None:
    """``params/p3dx.p`` of ARIA: x and y in mm, heading in degrees, from 0 at the front left to 15 at the rear left."""
    left = ((69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10))
    right = ((-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170))
    front, rear = ((*half, *((x, -y, -heading) for x, y, heading in reversed(half))) for half in (left, right))
    joints = {joint.child: joint for joint in read_joints("p3dx")}
    for number, (x, y, heading) in enumerate((*front, *rear)):
        joint = joints[f"sonar_{number}"]
        assert joint.xyz == pytest.approx((x / 1000, y / 1000, 0.0))
        assert joint.rotation() == pytest.approx(_turn(math.radians(heading)), abs=1e-9)


def _turn(yaw: float) -> tuple[float, ...]:
    yaw = math.remainder(yaw, math.tau)
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


@pytest.mark.parametrize(
    ("first", "last", "samples", "says"),
    [
        (0.5, 0.5, 10, "is 0.0000 rad"),
        (1.0, -1.0, 10, "is -2.0000 rad, not between 0 and 2 pi"),
        (-math.pi, math.pi, 10, "for a full turn, leave out angle_max"),
        (-1.0, 1.0, 1, "at least 2 samples"),
    ],
)
def test_a_field_of_view_is_less_than_a_turn(first: float, last: float, samples: int, says: str) -> None:
    given = {"link": "l", "rate": 1, "range_min": 0.1, "range_max": 1, "noise": 0, "clearance": 0.1}
    with pytest.raises(msgspec.ValidationError, match=says):
        msgspec.convert(given | {"samples": samples, "angle_min": first, "angle_max": last}, LaserConfig)


def test_rays_are_as_far_apart_as_the_field_of_view_says() -> None:
    found = {name: read_model(name).laser for name in ("burger", "p3dx")}
    steps = {name: math.degrees(laser.increment) for name, laser in found.items() if laser is not None}
    assert steps == {"burger": pytest.approx(1.0), "p3dx": pytest.approx(1.0)}


def test_the_optical_frame_looks_ahead() -> None:
    """The optical frame's z axis is the robot's x axis."""
    joints = {joint.child: joint for joint in read_joints("waffle")}
    x, y, z, w = joints["camera_rgb_optical_frame"].rotation()
    assert (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)) == pytest.approx((1.0, 0.0, 0.0))


def test_how_high_robots_reach_is_read_from_their_shapes(tmp_path: Path) -> None:
    """The burger's height is that of its maker's drawing, 192 mm; the arm's reaches the end of its upper link."""
    mast = samples.shape("collision", '<box size="0.02 0.02 0.5"/>', xyz="0 0 0.25")
    pole = samples.robot(samples.link("base_link", samples.inertial(), mast))
    samples.write(tmp_path / "rover.urdf", pole)
    rover = resolve_robot("rover.urdf", tmp_path).model
    tops = {"burger": 0.192, "p3dx": 0.4245, "waffle": 0.142, "arm": 1.38, rover: 0.5}
    for model, top in tops.items():
        low, high = vertical_extent(model)
        assert abs(low) < 1e-6
        assert abs(high - top) < 0.001, model
