"""The README of the fleet files: its examples are valid, and it names every key."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec

from deploy.fleet import ChangeConfig, Fleet, GridConfig, RobotConfig, RunConfig, ServiceConfig
from deploy.fleet_file import FLEETS, parse_fleet
from deploy.restart_policy import RestartPolicy
from services.runtime.process import ROOT

README = (FLEETS / "README.md").read_text()


def test_its_example_is_a_fleet() -> None:
    example, changes, services = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    assert parse_fleet(Path("example.toml"), example).name == "pair"
    lab = (FLEETS / "lab.toml").read_text()
    own = len(parse_fleet(Path("lab.toml"), lab).change)
    assert len(parse_fleet(Path("lab.toml"), f"{lab}\n{changes}").change) == own + 2
    added = parse_fleet(Path("lab.toml"), f"{lab}\n{services}").service[-2:]
    assert [each.kind for each in added] == ["static_transform", "map_server"]


def test_the_first_fleet_of_the_docs_is_a_fleet() -> None:
    example = re.findall(r"```toml\n(.*?)```", (ROOT / "docs/fleets.md").read_text(), re.DOTALL)[0]
    assert parse_fleet(Path("pair.toml"), example).name == "pair"


def test_it_names_every_key() -> None:
    keys = {
        each.name
        for record in (Fleet, RunConfig, RobotConfig, GridConfig, ServiceConfig, ChangeConfig, RestartPolicy)
        for each in msgspec.structs.fields(record)
    }
    keys = keys - {"mode_bounds", "folder"} | {"bounds.real", "bounds.lockstep"}  # their names in the file
    missing = [name for name in keys if not re.search(rf"(`|\[){name}\b|{name} = ", README)]
    assert missing == []
