"""Imported robots in a simulation: spawned by request or rejected with a reason, while the simulation continues."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from messages.gazebo import JointName
from messages.requests import DELETE, JOINT_PROPERTIES, LIST, MODEL_PROPERTIES, SPAWN, Name
from messages.se3 import IDENTITY, Pose3
from messages.simulation import SpawnModel
from messages.std import Empty
from messages.topics import ROBOT_DESCRIPTION
from models import urdf_path
from models.robot_source import resolve_robot
from models.urdf import parse_urdf
from models.world import WorldDescription
from services.runtime.errors import CallFailed
from services.runtime.step import STEP_NS
from services.sim.engines import default_engine, open_world
from services.sim.physics.world import Body, BodyState
from services.sim.robot_loader import on_the_ground
from tests.models.sample_robots import inertial, joint, link, robot, shape, write, write_meshes
from tests.services.sim.joints.joint_simulation import JointSimulation, run_joint_simulation

pytestmark = pytest.mark.slow

BOX = shape("collision", '<box size="0.3 0.2 0.1"/>')
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="1"/>'
ARMED = robot(
    link("base_link", inertial(2.0), BOX),
    link("arm", inertial(0.2, 1e-4), shape("collision", '<box size="0.02 0.02 0.2"/>')),
    joint("shoulder", "revolute", "base_link", "arm", '<origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>', LIMIT),
    name="armed",
)
"""A box on the ground with a rod on a joint; the root link is at the centre of the box."""


@contextmanager
def simulation(folder: Path) -> Iterator[JointSimulation]:
    """Run a simulation with one arm, whose requests may spawn robots from ``folder``."""
    with run_joint_simulation(folders=(str(folder),)) as made:
        yield made


def test_requests_spawn_paths_and_texts(tmp_path: Path) -> None:
    write_meshes(tmp_path / "meshes")
    looks = shape("visual", '<mesh filename="meshes/cube.stl" scale="0.1 0.1 0.1"/>')
    write(tmp_path / "armed.urdf", ARMED.replace("<collision>", f"{looks}<collision>", 1))
    with simulation(tmp_path) as on:
        described = on.subscribe(ROBOT_DESCRIPTION, "/mine/robot_description")
        state = on.call(SPAWN, SpawnModel(name="mine", model="./armed.urdf", pose=Pose3.planar(3, 0).to_msg()))
        assert (state.model, state.pose.position.x, state.pose.position.z) == ("armed", 3, 0.05)
        described.update()
        (text, _) = described.messages[-1]
        assert f'filename="file://{tmp_path}/meshes/cube.stl"' in text.data
        assert [each.name for each in parse_urdf(text.data).joints] == ["shoulder"]
        assert on.call(MODEL_PROPERTIES, Name(name="mine")).model == "armed"
        assert on.call(JOINT_PROPERTIES, JointName(model="mine", joint_name="shoulder")).upper == 1
        sent = SpawnModel(name="sent", model="my_arm", urdf=ARMED, pose=Pose3.planar(-3, 0).to_msg())
        assert on.call(SPAWN, sent).model == "my_arm"
        before = on.call(LIST, Empty()).models
        on.run(1.0)
        after = {each.name: each.pose.position for each in on.call(LIST, Empty()).models}
        assert [each.name for each in before] == ["arm", "mine", "sent"]
        assert after["mine"].z == pytest.approx(0.05, abs=2e-3), "it stands where it was put"

        on.call(DELETE, Name(name="mine"))
        write(tmp_path / "armed.urdf", ARMED.replace('upper="1"', 'upper="0.5"'))
        on.call(SPAWN, SpawnModel(name="mine", model="armed.urdf", pose=Pose3.planar(3, 0).to_msg()))
        found = on.call(JOINT_PROPERTIES, JointName(model="mine", joint_name="shoulder"))
        assert found.upper == 0.5, "a file that changed is read again"


def test_bad_robots_are_refused_and_the_simulation_goes_on(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    inside = tmp_path / "fleet"
    write_meshes(outside)
    write(outside / "armed.urdf", ARMED)
    write(inside / "code.xacro", ARMED)
    (inside / "huge.stl").write_bytes(bytes(80) + (2_000_000).to_bytes(4, "little") + b"x")
    bomb = "<!DOCTYPE r [" + "".join(f'<!ENTITY a{n + 1} "&a{n};&a{n};">' for n in range(30)) + "]>\n<robot/>"
    with simulation(inside) as on:
        cases = (
            (SpawnModel(model="../outside/armed.urdf"), "lies outside the folders"),
            (SpawnModel(model=f"{outside}/armed.urdf"), "lies outside the folders"),
            (SpawnModel(model="code.xacro"), "a xacro is code"),
            (SpawnModel(model="gone.urdf"), "there is no file"),
            (SpawnModel(model="brger"), "unknown model 'brger'; did you mean 'burger'"),
            (SpawnModel(urdf=bomb), "the URDF:1: the URDF declares a document type"),
            (SpawnModel(urdf=ARMED.replace("<box", '<mesh filename="package://no/x.stl"/><box', 1)), "no package 'no'"),
            (
                SpawnModel(urdf=ARMED.replace("<box", f'<mesh filename="file://{outside}/cube.stl"/><box', 1)),
                "the URDF:3: link 'base_link': collision: .* lies outside",
            ),
            (
                SpawnModel(urdf=ARMED.replace("<box", f'<mesh filename="file://{inside}/huge.stl"/><box', 1)),
                "2,000,000 triangles",
            ),
            (SpawnModel(urdf=ARMED.replace('lower="-1"', 'lower="2"')), "the URDF:5: .*lies above"),
            (SpawnModel(urdf=ARMED.replace("2.0", "two")), "the URDF:3: .*'two' is not a number"),
            (SpawnModel(urdf=ARMED.replace('"arm"', '"base_link"')), "the URDF:"),
            (SpawnModel(urdf="hello"), "the URDF:1: the URDF is not XML"),
        )
        for request, told in cases:
            asked = SpawnModel(name="new", model=request.model, urdf=request.urdf, pose=Pose3.planar(3, 0).to_msg())
            with pytest.raises(CallFailed, match=told):
                on.call(SPAWN, asked)
        tick = on.simulation.tick
        on.run(0.1)
        assert on.simulation.tick == tick + 20
        assert [each.name for each in on.call(LIST, Empty()).models] == ["arm"]


def test_a_root_whose_mass_is_elsewhere_is_where_it_is_put(tmp_path: Path) -> None:
    """The engine places the root by its centre of mass, all other code by its link frame."""
    moved = ARMED.replace("<inertial>", '<inertial><origin xyz="0.1 0.05 0.02" rpy="0.3 0 0.5"/>', 1)
    path = write(tmp_path / "r.urdf", moved.replace('ixy="0"', 'ixy="0.002"', 1))
    model = resolve_robot(str(path), tmp_path).model
    pose = on_the_ground(model, Pose3.planar(1.0, 2.0, math.pi / 2))
    assert pose.position[2] == 0.05
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:
        body = world.spawn(Body("r", Path(model) / "physics.urdf", pose))
        assert body.state().position == pytest.approx(pose.position, abs=1e-9)
        assert body.link_pose("base_link").orientation == pytest.approx(pose.orientation, abs=1e-6)
        assert body.link_state("arm").position == pytest.approx((1.0, 2.0, 0.25), abs=1e-6)
        wanted = BodyState((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.0, 1.0))
        world.set_state("r", wanted)
        found = body.state()
        assert found.position == pytest.approx(wanted.position, abs=1e-9)
        assert found.linear == pytest.approx(wanted.linear, abs=1e-9)
        world.step()
        assert body.state().position[0] == pytest.approx(0.0025, abs=1e-4)
        world.reset()
        assert body.state().position == pytest.approx(pose.position, abs=1e-9)


def test_a_root_below_the_wheels_does_not_fall(tmp_path: Path) -> None:
    raised = ARMED.replace('<origin xyz="0 0 0"', '<origin xyz="0 0 0.06"', 1)
    model = resolve_robot(str(write(tmp_path / "r.urdf", raised)), tmp_path).model
    assert on_the_ground(model, Pose3()).position[2] == pytest.approx(-0.01)
    assert on_the_ground(model, Pose3(), 0.5).position[2] == pytest.approx(0.49), "nor on a ramp"
    assert on_the_ground(model, Pose3((0.0, 0.0, 0.2))).position[2] == 0.2, "as it is told"


def test_damping_beyond_what_a_step_carries_drives_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "r.urdf", ARMED.replace("</joint>", '<dynamics damping="50"/></joint>'))
    model = resolve_robot(str(path), tmp_path).model
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:
        body = world.spawn(
            Body("r", Path(model) / "physics.urdf", Pose3((0.0, 0.0, 1.0), IDENTITY.orientation), fixed=True)
        )
        inertia = 1e-4
        assert body.limited_damping == {"shoulder": pytest.approx(inertia / (STEP_NS / 1e9), rel=1e-2)}
        for _ in range(200):
            body.set_efforts({"shoulder": 0.001})
            world.step()
        assert 0 < body.joint_readings().velocity[0] < 0.1


def test_a_robot_of_the_parameters_is_read_by_its_path(tmp_path: Path) -> None:
    path = write(tmp_path / "armed.urdf", ARMED)
    with run_joint_simulation({"name": "mine", "model": str(path)}) as on:
        assert on.call(MODEL_PROPERTIES, Name(name="mine")).links == ("base_link", "arm")
    assert urdf_path(resolve_robot(str(path), tmp_path).model).read_text() == ARMED
