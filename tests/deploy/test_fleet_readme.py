"""The README of the fleet files: its example is good, and it names every key."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec

from deploy.fleet import ChangeConfig, Fleet, RobotConfig, RunConfig, ServiceConfig
from deploy.fleet_file import FLEETS, fleet_names, parse_fleet
from deploy.restart_policy import RestartPolicy

README = (FLEETS / "README.md").read_text()


def test_its_example_is_a_fleet() -> None:
    example, changes = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    assert parse_fleet(Path("example.toml"), example).name == "pair"
    lab = (FLEETS / "lab.toml").read_text()
    own = len(parse_fleet(Path("lab.toml"), lab).change)
    assert len(parse_fleet(Path("lab.toml"), f"{lab}\n{changes}").change) == own + 2


def test_it_names_every_key_and_every_fleet() -> None:
    keys = {
        each.name
        for record in (Fleet, RunConfig, RobotConfig, ServiceConfig, ChangeConfig, RestartPolicy)
        for each in msgspec.structs.fields(record)
    }
    keys = keys - {"mode_bounds"} | {"bounds.real", "bounds.lockstep"}  # what the file calls them
    missing = [name for name in (*keys, *fleet_names()) if not re.search(rf"(`|\[){name}\b|{name} = ", README)]
    assert missing == []
