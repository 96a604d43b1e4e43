"""The world of a fleet file: by name, or by path from the file's folder; errors with their line."""

from pathlib import Path

import pytest

from deploy.fleet_file import parse_fleet
from deploy.service_parameters import NodeGroups, RunOptions, service_parameters
from models.world import read_world
from services.runtime.errors import BadInput

FLEET = 'name = "mine"\nworld = "WORLD"\n[[robot]]\nname = "r"\nmodel = "burger"\n'
SITE = 'start = { x = 3.0, y = 1.0 }\n[[bodies]]\nname = "ball"\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n'


def world_of_sim(folder: Path, text: str, *overrides: str) -> str:
    fleet = parse_fleet(folder / "fleet.toml", text, overrides)
    own = next((each.parameters for each in fleet.service if each.kind == "sim"), {})
    parameters = service_parameters("sim", fleet, RunOptions(folder=folder), NodeGroups()) | own
    return str(parameters["world"])


def test_a_world_is_found_by_name_or_from_the_folder_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "worlds" / "site.toml"
    site.parent.mkdir()
    site.write_text(SITE)
    by_path = FLEET.replace("WORLD", "worlds/site.toml")
    assert world_of_sim(tmp_path, FLEET.replace("WORLD", "arena")) == "arena"
    assert world_of_sim(tmp_path, by_path) == str(site)
    assert world_of_sim(tmp_path, FLEET.replace('world = "WORLD"\n', "")) == "empty"
    of_sim = (
        FLEET.replace("WORLD", "arena") + '[[service]]\nkind = "sim"\nparameters = { world = "worlds/site.toml" }\n'
    )
    assert world_of_sim(tmp_path, of_sim) == str(site)
    assert world_of_sim(tmp_path, of_sim, "world=house") == "house"
    monkeypatch.chdir(site.parent)
    assert world_of_sim(tmp_path, by_path, "world=./site.toml") == str(site)
    placed = parse_fleet(tmp_path / "fleet.toml", by_path.replace('"burger"', '"burger"\npose = "world"'))
    assert (placed.robot[0].pose.x, placed.robot[0].pose.y) == (3.0, 1.0)


def test_models_of_a_world_are_found_in_the_packages_of_the_fleet(tmp_path: Path) -> None:
    model = tmp_path / "elsewhere" / "models" / "stone"
    model.mkdir(parents=True)
    (model / "model.sdf").write_text(
        '<sdf version="1.7"><model name="stone"><link name="l"><collision name="c"><geometry><sphere/></geometry>'
        "</collision></link></model></sdf>"
    )
    (tmp_path / "fleet").mkdir()
    (tmp_path / "fleet" / "yard.sdf").write_text(
        '<sdf version="1.7"><world name="w">\n<include><uri>model://stone</uri></include></world></sdf>'
    )
    text = FLEET.replace("WORLD", "yard.sdf")
    bare = read_world(world_of_sim(tmp_path / "fleet", text))
    assert ([each.name for each in bare.bodies], len(bare.missing)) == ([], 1)
    assert "yard.sdf:2: left out: there is no model 'stone'" in bare.missing[0]
    with_stone = text + '[run]\npackages = ["../elsewhere"]\n'
    found = read_world(world_of_sim(tmp_path / "fleet", with_stone), packages=[tmp_path / "elsewhere"])
    assert ([each.name for each in found.bodies], found.missing) == (["stone"], ())


def test_a_wrong_world_is_told_with_the_line_of_the_fleet_file_and_its_own(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(SITE.replace("sphere", "spere"))
    for world, told in {
        "aerna": ":2: unknown world 'aerna'; did you mean 'arena'?",
        "none.toml": ":2: there is no world file",
        "bad.toml": f":2: {tmp_path}/bad.toml:4: unknown shape 'spere'; did you mean 'sphere'?",
    }.items():
        with pytest.raises(BadInput) as error:
            world_of_sim(tmp_path, FLEET.replace("WORLD", world))
        assert str(error.value).startswith(f"{tmp_path}/fleet.toml{told}"), error.value
    with pytest.raises(BadInput, match="--set world=aerna: unknown world 'aerna'"):
        world_of_sim(tmp_path, FLEET.replace("WORLD", "arena"), "world=aerna")
