"""Controller files named by a fleet: found next to its file, checked with it, and their gains announced."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.fleet_file import read_fleet
from deploy.parameter_sets import fleet_values, parameter_sets
from deploy.processes import plan_processes
from deploy.service_parameters import RunOptions, grader_arms
from services.runtime.errors import BadInput
from tests.harness.cases import case

CONTROLLERS = """\
bear_controller:
  type: effort_controllers/JointPositionController
  joint: bear_link
  pid: {p: 100, d: 3}
states: {type: joint_state_controller/JointStateController, publish_rate: 40}
"""
WHEEL = "turn: {type: velocity_controllers/JointVelocityController, joint: wheel_left_joint}\n"


def fleet_text(parameters: str = '{ config = "sub/c.yaml" }', model: str = "arm", more: str = "") -> str:
    member = f"{{ kind = 'controller_manager', parameters = {parameters} }}"
    return f'name = "f"\n[[robot]]\nname = "a"\nmodel = "{model}"\nservices = [{member}]\n{more}'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a controller file for the arm and one for a wheel."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "c.yaml").write_text(CONTROLLERS)
    (tmp_path / "sub" / "wheel.yaml").write_text(WHEEL)
    return tmp_path


def test_the_file_counts_from_the_fleet_and_its_gains_are_sets_of_parameters(folder: Path) -> None:
    change = '[[change]]\nat = 1\nset = "/a/bear_controller/pid"\nvalues = { p = 50.0 }\n'
    (folder / "f.toml").write_text(fleet_text(more=change))
    fleet = read_fleet(folder / "f.toml")
    assert "/a/bear_controller/pid" in parameter_sets(fleet)
    plan = plan_processes(fleet, RunOptions(folder=folder))
    [manager] = [each for each in plan if each.kind == "controller_manager"]
    assert f'config="{folder / "sub" / "c.yaml"}"' in manager.argv
    assert 'robot="a"' in manager.argv
    assert fleet_values(fleet, plan)["/a/bear_controller/pid"]["p"] == 100.0
    [sim] = [each for each in plan if each.kind == "sim"]
    assert any('"joint_state_rate": 40.0' in each for each in sim.argv)
    assert grader_arms(fleet) == [], "the exercise of the arm service is not that of a controller manager"


def test_mistakes_name_both_files(folder: Path) -> None:
    wheel, twice = '{ config = "sub/wheel.yaml" }', '{ config = "sub/c.yaml", controllers = ["bear_controler"] }'
    shared = "[[service]]\nkind = 'controller_manager'\nparameters = { config = 'sub/c.yaml' }\n"
    change = '[[change]]\nat = 1\nset = "/a/bear_controller/pid"\nvalues = { p = 1e9 }\n'
    for text, told in (
        (fleet_text("{ }"), r'f\.toml:5: a controller_manager needs parameters = \{ config = "controllers\.yaml" \}'),
        (fleet_text('{ config = "d.yaml" }'), r"f\.toml:5: there is no controller file .*/d\.yaml"),
        (fleet_text(model="burger"), r"f\.toml:5: .*/sub/c\.yaml:2: bear_controller: unknown joint 'bear_link'"),
        (fleet_text(wheel, "burger"), r"f\.toml:5: .*/sub/wheel\.yaml:1: turn: wheel_left_joint is a wheel, which the"),
        (fleet_text(twice), r"f\.toml:5: unknown controller 'bear_controler'; did you mean 'bear_controller'"),
        (fleet_text(more=shared), r"f\.toml:6: a controller_manager is for one robot"),
        (fleet_text(more=change), r"f\.toml:9: .*p"),
    ):
        (folder / "f.toml").write_text(text)
        with case(told), pytest.raises(BadInput, match=told):
            read_fleet(folder / "f.toml")
