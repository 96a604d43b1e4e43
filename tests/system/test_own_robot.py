"""A user's robot in a real fleet: read-only, outside the checkout, shown, recorded, and joined by a spawned one."""

from __future__ import annotations

import json
import os
from pathlib import Path

from messages.topics import ROBOT_DESCRIPTION
from models.urdf import parse_urdf
from services.bag.reader import MessageDecoder, open_bag
from services.runtime.process import ROOT
from tests.harness.background_fleet import background_fleet
from tests.models.sample_robots import shape, write, write_meshes
from tests.services.sim.test_robots_from_outside import ARMED

FLEET = """
name = "own"

[run]
mode = "real"
ends = "never"

[[robot]]
name = "mine"
model = "robots/armed.urdf"

[[service]]
kind = "logger"

[[service]]
kind = "recorder"
"""
XACRO = '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="upper" default="1"/>'


def test_a_robot_of_the_user_lives_beside_those_that_come_with_elea(tmp_path: Path) -> None:
    write_meshes(tmp_path / "robots" / "meshes")
    looks = shape("visual", '<mesh filename="meshes/cube.dae" scale="0.1 0.1 0.1"/>')
    own = write(tmp_path / "robots" / "armed.urdf", ARMED.replace("<collision>", f"{looks}<collision>", 1))
    body = ARMED.partition('name="armed">')[2].replace('upper="1"', 'upper="$(arg upper)"')
    xacro = write(tmp_path / "elsewhere" / "guest.urdf.xacro", XACRO + body)
    for each in (tmp_path / "robots" / "meshes", tmp_path / "robots"):
        os.chmod(each, 0o500)
    before = {each: each.stat().st_mtime_ns for each in (ROOT / "models").iterdir()}
    with background_fleet(tmp_path, FLEET) as fleet:
        told = fleet.run("sim", "spawn", str(xacro), "guest", "-x", "2", "--arg", "upper:=0.5")
        assert "spawned guest" in told.out
        (joint,) = fleet.run_json("sim", "joints", "guest")
        assert joint["upper"] == 0.5
        for request, reason in (
            ({"model": "/etc/passwd"}, "lies outside the folders"),
            ({"model": str(xacro)}, "a xacro is code"),
            ({"model": "robots/gone.urdf"}, "there is no file"),
            ({"urdf": XACRO + body}, "is a xacro, which is code"),
            ({"urdf": ARMED.replace("2.0", "nan")}, "the URDF:3: link 'base_link': value='nan' is not a number"),
        ):
            refused = fleet.run("service", "call", "/sim/spawn", json.dumps({"name": "bad", **request}), status=1)
            assert reason in refused.err
        names = [(each["name"], each["model"]) for each in fleet.run_json("sim", "list")["models"]]
        assert names == [("mine", "armed"), ("guest", "guest")]
        fleet.run("down")
        terminal = fleet.command_line
        assert "mine: assumptions about armed" not in (tmp_path / "results" / "logs" / "sim.log").read_text()
    assert before == {each: each.stat().st_mtime_ns for each in (ROOT / "models").iterdir()}

    typed = MessageDecoder()
    described = [
        typed.decode(entry)
        for entry in open_bag(tmp_path / "results" / "bag").entries()
        if entry.channel.name == f"/mine/{ROBOT_DESCRIPTION.name}"
    ]
    assert f"file://{own.parent}/meshes/cube.dae" in described[0].data
    assert parse_urdf(described[0].data).root == "mine/base_link", "viewers find the robot's frames"
    shown = terminal.run("bag", "export", str(tmp_path / "results" / "bag"), "--to", "rrd")
    assert shown.status == 0, shown.err
    assert "/guest (x), /mine (armed)" in shown.out, "by the names in their URDFs"
    log = (tmp_path / "results" / "logs" / "logger.log").read_text()
    assert "ERROR" not in log
