"""Imported robots, in the style of published ones, are understood and driven from their URDF alone."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from deploy.commands.model import command
from services.sim import model_check
from services.sim.engines import ENGINES, Engine, has_engine
from services.sim.model_check import ModelCheck, check_model
from tests.models import robots
from tests.models.sample_robots import ACROSS, INERTIAL_OF_BASE, car, inertial, joint, link, robot, shape, write

pytestmark = pytest.mark.slow

FOLDER = Path(robots.__file__).parent

Checker = Callable[[str], ModelCheck]


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Checker:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return lambda name: check_model(f"{name}.urdf", FOLDER)


def errors(found: ModelCheck) -> list[float]:
    return [each.error for each in found.trials]


def test_a_differential_robot_on_its_base_link(check: Checker) -> None:
    found = check("courier")
    base = found.base
    assert base is not None
    assert (base.kind, base.left_joints, base.odometry) == ("differential", ("left_wheel_joint",), "encoder")
    assert (base.radius, base.shape_radius, base.separation) == pytest.approx((0.06, 0.06, 0.3))
    assert found.height == pytest.approx(0.06), "its root is at the height of the axle"
    assert [each.kind for each in found.sensors] == ["laser", "imu"]
    assert found.ok, found
    assert max(map(abs, errors(found))) < 1e-3
    assert len(found.ignored) == 3


def test_a_skid_steer_turns_as_it_is_told(check: Checker) -> None:
    found = check("ranger")
    assert found.base is not None
    assert (found.base.kind, len(found.base.left_joints)) == ("skid steer", 2)
    assert found.ok, found
    assert max(map(abs, errors(found))) < 2e-3
    turn = found.trials[1]
    assert turn.counted == pytest.approx(turn.actual, rel=2e-3), "its wheels count what it turned"


def test_a_holonomic_robot_goes_sideways(check: Checker) -> None:
    found = check("glider")
    assert [each.name for each in found.trials] == ["1 m straight", "1 m sideways", "360 deg on the spot"]
    assert found.ok, found
    assert max(map(abs, errors(found))) < 1e-3


@pytest.mark.process
def test_a_xacro_with_laser_and_camera(check: Checker) -> None:
    found = check_model("scout.urdf.xacro", FOLDER, xacro_args={"camera": True})
    assert [(each.kind, each.link, each.frame) for each in found.sensors] == [
        ("laser", "lidar", "lidar"),
        ("camera", "camera", "camera_optical"),
    ]
    assert found.topics == {"camera/image": "camera/image_raw"}
    assert found.ok, found
    assert max(map(abs, errors(found))) < 2e-3
    assert len(check_model("scout.urdf.xacro", FOLDER, False, xacro_args={"camera": False}).sensors) == 1


def test_an_arm_moves_each_joint(check: Checker) -> None:
    found = check("picker")
    assert found.base is None
    assert found.fixed_base
    assert [each.interfaces for each in found.joints] == [("effort",)] * 3 + [("position",)]
    assert [each.name for each in found.trials] == ["shoulder_joint", "upper_joint", "fore_joint", "hand_joint"]
    assert found.ok, found
    assert all(each.actual == pytest.approx(each.commanded, rel=0.01) for each in found.trials)


def test_what_is_broken_is_named_and_driven_all_the_same(check: Checker) -> None:
    found = check("cracked")
    assert not found.ok
    assert len(found.broken) == 2
    assert "link 'base_link': its principal moments 0.01, 0.02 and 0.09 kg m2 violate the triangle" in found.broken[0]
    assert "link 'left_wheel' has no mass" in found.broken[1]
    assert any("'lidar_link': its largest moment of 1 kg m2 is x6" in each for each in found.doubts)
    assert len(found.trials) == 2


def test_the_command_tells_it_and_ends_by_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    whole = (FOLDER / "courier.urdf").read_text()
    own = tmp_path / "courier.urdf"
    own.write_text(whole)
    run = CliRunner()
    plain = run.invoke(command, ["check", str(own)])
    assert plain.exit_code == 0
    assert "wheel radius  0.06 m, by the shapes 0.06 m" in plain.output
    assert plain.output.endswith("ok\n")
    asked = run.invoke(command, ["check", str(own), "--json", "--no-drive"])
    assert json.loads(asked.output)["base"]["separation"] == 0.3
    assert json.loads(asked.output)["trials"] == []

    own.write_text(whole.replace('<cylinder radius="0.04" length="0.05"/>', '<mesh filename="lost.stl"/>'))
    missing = run.invoke(command, ["check", str(own), "--no-drive"])
    assert missing.exit_code == 1
    assert "lost.stl is missing" in missing.output

    own.write_text(whole.replace("<leftJoint>left_wheel_joint", "<leftJoint>left_whel_joint"))
    wrong = run.invoke(command, ["check", str(own)])
    assert "courier.urdf:88: unknown wheel joint 'left_whel_joint'; did you mean 'left_wheel_joint'" in str(
        wrong.exception
    )


def test_wheels_without_a_tag_are_found_by_their_shapes(tmp_path: Path, check: Checker) -> None:
    text = (FOLDER / "courier.urdf").read_text()
    bare = tmp_path / "bare.urdf"
    bare.write_text(text[: text.index("  <gazebo")] + "</robot>")
    found = check_model(str(bare), tmp_path)
    assert found.base is not None
    assert (found.base.left_joints, found.base.right_joints) == (("left_wheel_joint",), ("right_wheel_joint",))
    assert found.base.separation == pytest.approx(0.3)
    assert "no tag defines a drive" in found.notes[-1]
    assert found.ok, found


def wheeled(mount: str, *more: str) -> str:
    """Return a robot on two wheels, mirrored copies of one, and two skids; ``mount`` is the type of the joints that
    carry the wheels. Its root is 5 mm below the wheels' lowest points.
    """
    base = link("base_link", INERTIAL_OF_BASE, shape("collision", '<box size="0.3 0.2 0.05"/>', "0 0 0.1"))
    parts = [base, *more]
    for side, y, turn in (("left", 0.15, "0"), ("right", -0.15, "3.14159265")):
        limit = '<limit lower="0" upper="0.03" effort="0" velocity="0"/>'
        parts += [
            joint(f"{side}_drop", mount, "base_link", f"{side}_mount", f'<origin xyz="0 {y} 0.055"/>', DOWN, limit),
            link(f"{side}_mount", inertial(0.05, 1e-5)),
            joint(
                f"{side}_joint", "continuous", f"{side}_mount", f"{side}_wheel", f'<origin rpy="{turn} 0 0"/>', ACROSS
            ),
            link(f"{side}_wheel", inertial(0.3, 2e-4), shape("collision", WHEEL, rpy="1.5707963 0 0")),
        ]
    for name, x in (("fore", 0.12), ("aft", -0.12)):
        parts += [
            joint(f"{name}_joint", "fixed", "base_link", name, f'<origin xyz="{x} 0 0.025"/>'),
            link(name, inertial(0.05, 1e-5), shape("collision", '<sphere radius="0.02"/>')),
        ]
    return robot(*parts)


WHEEL = '<cylinder radius="0.05" length="0.02"/>'
DOWN = '<axis xyz="0 0 -1"/>'


def test_wheels_in_mirror_image_turn_opposite_ways_to_drive_ahead(tmp_path: Path, check: Checker) -> None:
    found = check_model(str(write(tmp_path / "mirrored.urdf", wheeled("fixed"))), tmp_path)
    assert "wheels with reversed axes, which turn backwards to drive forwards: right_joint" in found.notes
    assert found.ok, found
    assert max(map(abs, errors(found))) < 2e-3
    straight, turn = found.trials
    assert straight.counted == pytest.approx(1.0, rel=5e-3), "they count it as the way ahead"
    assert turn.counted == pytest.approx(turn.actual, rel=5e-3)


def test_the_ground_is_not_in_the_way_of_an_arm_that_stands_on_it(tmp_path: Path, check: Checker) -> None:
    rod = shape("collision", '<box size="0.6 0.04 0.04"/>', "0.4 0 0")
    low = robot(
        link("world"),
        joint("mount", "fixed", "world", "stand"),
        link("stand", inertial(2.0)),
        joint(
            "shoulder",
            "revolute",
            "stand",
            "rod",
            '<origin xyz="0 0 0.1"/>',
            ACROSS,
            '<limit lower="-1" upper="1" effort="50" velocity="2"/>',
        ),
        link("rod", inertial(0.5, 0.02), rod),
    )
    found = check_model(str(write(tmp_path / "low.urdf", low)), tmp_path)
    assert found.fixed_base
    assert [each.name for each in found.trials] == ["shoulder"]
    assert found.ok, found


def test_wheels_on_springs_drive(tmp_path: Path, check: Checker) -> None:
    found = check_model(str(write(tmp_path / "sprung.urdf", wheeled("prismatic"))), tmp_path)
    assert found.base is not None
    assert (found.base.left_joints, found.base.right_joints) == (("left_joint",), ("right_joint",))
    assert (
        found.notes[-1] == "wheel suspensions, which are fixed since springs are not simulated: left_drop, right_drop"
    )
    assert [each.name for each in found.joints] == ["left_joint", "right_joint"], "the drops are fixed for everybody"
    assert found.ok, found
    assert max(map(abs, errors(found))) < 2e-3


@pytest.mark.parametrize(
    ("front", "engine"),
    [*(((0.2, -0.2), each) for each in ENGINES if has_engine(each)), ((0.0,), "mujoco")],
)
def test_steered_wheels_lead_around_a_circle(
    tmp_path: Path, check: Checker, monkeypatch: pytest.MonkeyPatch, engine: Engine, front: tuple[float, ...]
) -> None:
    monkeypatch.setattr(model_check, "default_engine", lambda: engine)
    found = check_model(str(write(tmp_path / "car.urdf", car(front))), tmp_path)
    assert found.base is not None
    assert (found.base.kind, found.base.left_joints, found.base.right_joints) == (
        "steered",
        ("rear_left",),
        ("rear_right",),
    )
    assert [each.name for each in found.joints if each.role == "steering"] == [f"steer_{n}" for n in range(len(front))]
    straight, circle = found.trials[:2]
    assert (straight.name, circle.name) == ("1 m straight", "360 deg on a circle")
    assert found.ok, found
    assert max(abs(straight.error), abs(circle.error)) < 5e-3
    assert circle.counted == pytest.approx(circle.actual, rel=1e-2), "its rear wheels count the turn"


def test_a_caster_does_not_steer(tmp_path: Path, check: Checker) -> None:
    trailing = car((0.0,)).replace(
        '<child link="front_wheel_0"/>', '<child link="front_wheel_0"/><origin xyz="-0.05 0 0"/>'
    )
    found = check_model(str(write(tmp_path / "caster.urdf", trailing)), tmp_path, drive=False)
    assert found.base is not None
    assert found.base.kind == "differential"


def test_tyres_on_hubs_drive(tmp_path: Path, check: Checker) -> None:
    text = (FOLDER / "courier.urdf").read_text()
    mass = inertial(0.05, 2e-5)
    look = '<visual><geometry><cylinder radius="0.04" length="0.06"/></geometry></visual>'
    for side in ("left", "right"):
        hub, tyre = f"{side}_hub", f"{side}_wheel"
        text = text.replace(f'<child link="{tyre}"/>', f'<child link="{hub}"/>')
        text = text.replace(
            f'<link name="{tyre}">',
            f'<link name="{hub}">{mass}{look}<collision><geometry><box size="0 0 0"/></geometry></collision></link>'
            f'<joint name="{hub}_fixed" type="fixed"><parent link="{hub}"/><child link="{tyre}"/></joint>'
            f'<link name="{tyre}">',
        )
    own = tmp_path / "hubs.urdf"
    own.write_text(text)
    found = check_model(str(own), tmp_path)
    assert found.base is not None
    assert (found.base.radius, found.base.shape_radius) == pytest.approx((0.06, 0.06)), (
        "that of what touches the ground"
    )
    assert found.ok, found
    assert max(map(abs, errors(found))) < 1e-3
    plain = text[: text.index("  <gazebo")] + "</robot>"
    own.write_text(plain)
    guessed = check_model(str(own), tmp_path, drive=False).base
    assert guessed is not None
    assert guessed.left_joints == ("left_wheel_joint",)
    assert guessed.radius == pytest.approx(0.06)


def test_supports_a_little_lower_than_the_wheels_let_them_stand(tmp_path: Path, check: Checker) -> None:
    text = (FOLDER / "courier.urdf").read_text()
    pair = (
        '<link name="{0}"><inertial><mass value="0.02"/><inertia ixx="1e-6" iyy="2e-6" izz="1e-6" ixy="0" ixz="0" '
        'iyz="0"/></inertial><collision><origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.02" '
        'length="0.02"/></geometry></collision></link><joint name="{0}_joint" type="fixed"><parent link="base_link"/>'
        '<child link="{0}"/><origin xyz="{1} 0 -0.042"/></joint>'
    )
    own = tmp_path / "rocking.urdf"
    own.write_text(text.replace("</robot>", pair.format("fore", 0.15) + pair.format("aft", -0.12) + "</robot>"))
    found = check_model(str(own), tmp_path)
    assert found.ok, found
    assert found.height == pytest.approx(0.06), "it stands on its wheels, not on what reaches 2 mm lower"


def test_a_model_of_ours_is_checked_by_its_name(check: Checker) -> None:
    found = check_model("burger", FOLDER)
    assert found.ok, found
    assert max(map(abs, errors(found))) < 2e-3
    assert math.isclose(found.mass, 1.004, abs_tol=1e-3)
