"""Robots that a fleet file names by path; mistakes are reported with their line before anything starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.fleet_file import parse_fleet, read_fleet
from deploy.service_parameters import NodeGroups, RunOptions, service_parameters
from models import display_name, urdf_path
from models.urdf import read_robot
from services.runtime.errors import BadInput
from services.runtime.parameters.validation import build
from services.sim import SimParameters
from tests.models.sample_robots import inertial, link, robot, shape, write, write_meshes, write_package
from tests.services.sim.test_robots_from_outside import ARMED

FLEET = """name = "mine"

[run]
packages = ["../packages"]

[[robot]]
name = "a"
model = "../robots/armed.urdf"
pose = { y = 1.0, z = 0.5 }
parameters = { damping = 0.2 }

[[robot]]
name = "b"
model = "burger"

[[every_robot]]
kind = "state"
models = ["armed"]
"""


def write_robots(folder: Path) -> Path:
    """Write robots and packages beside a fleet file's folder; return that file."""
    write_meshes(write_package(folder / "packages" / "parts", "parts") / "meshes")
    mesh = shape("visual", '<mesh filename="package://parts/meshes/cube.dae" scale="0.1 0.1 0.1"/>')
    write(folder / "robots" / "armed.urdf", ARMED.replace("<collision>", f"{mesh}<collision>", 1))
    return write(folder / "fleets" / "mine.toml", FLEET)


def test_a_path_counts_from_the_fleet_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_robots(tmp_path)
    monkeypatch.chdir("/")
    fleet = read_fleet(path)
    own = fleet.robot[0]
    assert display_name(own.model) == "armed"
    assert f"file://{tmp_path}/packages/parts/meshes/cube.dae" in urdf_path(own.model).read_text()
    assert [len(fleet.shared_services(each)) for each in fleet.robot] == [1, 0], "models goes by the robot's name"
    told = service_parameters("sim", fleet, RunOptions(folder=tmp_path), NodeGroups())
    sim = build(SimParameters, {name: told[name] for name in ("robots", "model_folders")})
    assert (sim.robots[0].z, sim.robots[0].joint_parameters.damping) == (0.5, 0.2)
    assert sim.model_folders == (str(path.parent), str(tmp_path / "packages"))
    home = FLEET.replace('"../robots/armed.urdf"', '"~/robots/armed.urdf"')
    monkeypatch.setenv("HOME", str(tmp_path))
    assert parse_fleet(path, home).robot[0].model == own.model


@pytest.mark.process
def test_arguments_of_a_xacro_come_from_the_fleet_file(tmp_path: Path) -> None:
    path = write_robots(tmp_path)
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="n" default="x"/>'
    many = f'{head}<link name="$(arg n)_${{2 * $(arg size)}}_$(arg on)">{inertial()}</link></robot>'
    write(tmp_path / "fleets" / "many.xacro", many)
    text = FLEET.replace('"../robots/armed.urdf"', '"many.xacro"').replace("armed", "many")
    stated = text.replace("pose = { y", 'xacro_args = { n = "left", size = 1.5, on = true }\npose = { y')
    (only,) = read_robot(parse_fleet(path, stated).robot[0].model).links
    assert only.name == "left_3.0_true"
    with pytest.raises(BadInput, match=r"mine.toml:8: .*many.xacro:1: the argument size is not set"):
        parse_fleet(path, text)


def test_what_is_wrong_is_told_with_its_line(tmp_path: Path) -> None:
    path = write_robots(tmp_path)
    bad = write(tmp_path / "fleets" / "bad.urdf", robot(link("base", inertial(mass=float("nan")))))
    cases = {
        ('"../robots/armed.urdf"', '"bad.urdf"'): rf"mine.toml:8: {bad}:3: link 'base': value='nan' is not a number",
        ('"../robots/armed.urdf"', '"gone.urdf"'): r"mine.toml:8: there is no file .*gone.urdf",
        ('"../robots/armed.urdf"', '"brger"'): r"mine.toml:8: unknown model 'brger'; did you mean 'burger'",
        ('"../packages"', '"../package"'): r"mine.toml:4: packages: there is no folder '../package'",
        ("[run]\npackages", "[run]\nseed = 1\n# packages"): r"mine.toml:9: .*armed.urdf:3: .*no package 'parts'",
        ('["armed"]', '["armd"]'): r"mine.toml:18: unknown model 'armd'; did you mean 'armed'",
        ("damping", "damping_of"): r"mine.toml:10: unknown parameter 'damping_of'",
        ("pose = { y", "xacro_args = { a = 1 }\npose = { y"): r"mine.toml:8: .*xacro_args are only for a xacro",
        ("pose = { y", "xacro_args = { a = [1] }\npose = { y"): r"mine.toml:9: robot\[0\].xacro_args",
        ('model = "burger"', 'model = "burger"\nxacro_args = { a = 1 }'): r"xacro_args are only for a xacro: 'burger'",
        ('name = "mine"\n', 'name = "mine"\nfolder = "/"\n'): r"mine.toml:2: unknown key 'folder'",
    }
    for (old, new), told in cases.items():
        assert old in FLEET
        with pytest.raises(BadInput, match=told):
            parse_fleet(path, FLEET.replace(old, new, 1))
