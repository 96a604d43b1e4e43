"""``interface list`` and ``interface show`` describe every type as its record defines it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from deploy.interfaces import describe_fields, describe_type, find_interface, list_types
from messages.records import RECORDS
from messages.requests import REQUESTS
from services.runtime.errors import BadInput
from services.runtime.process import ROOT
from tests.harness.cases import case
from tests.harness.fork_server import run_verb


def test_every_record_is_described_whole() -> None:
    for name, kind in RECORDS.items():
        with case(name):
            described = describe_type(kind)
            assert described["type"] == name
            assert described["about"]
            json.dumps(described)
            assert '"any"' not in json.dumps(described["fields"])


def test_fields_have_their_types_units_bounds_and_defaults() -> None:
    odometry = {each["name"]: each for each in describe_fields(RECORDS["nav_msgs/Odometry"])}
    assert list(odometry) == ["header", "child_frame_id", "pose", "twist"]
    header = {each["name"]: each for each in odometry["header"]["fields"]}
    nanosec = header["stamp"]["fields"][1]
    assert (nanosec["type"], nanosec["unit"], nanosec["bounds"]) == ("int", "ns", "0 to 1000000000 (exclusive)")
    assert odometry["pose"]["fields"][1]["type"] == "float[36]"
    [x, *_] = odometry["pose"]["fields"][0]["fields"][0]["fields"]
    assert (x["name"], x["type"], x["unit"], x["bounds"], x["default"]) == ("x", "float", "m", "finite", 0.0)
    status = {each["name"]: each for each in describe_fields(RECORDS["elea_msgs/GoalStatus"])}
    assert set(status["state"]["choices"]) == {"idle", "driving", "reached", "finished", "waiting"}
    drive = {each["name"]: each for each in describe_fields(RECORDS["elea_msgs/DriveSettings"])}
    assert drive["publish_rate"]["optional"]
    assert drive["publish_rate"]["bounds"] == "0 to 50"
    scan = {each["name"]: each for each in describe_fields(RECORDS["sensor_msgs/LaserScan"])}
    assert scan["ranges"]["type"] == "float32[]"
    assert describe_type(RECORDS["sensor_msgs/Range"])["constants"] == {"ULTRASOUND": 0, "INFRARED": 1}


@pytest.mark.parametrize("name", ["geometry_msgs/Twist", "geometry_msgs/msg/Twist"])
def test_show_takes_both_spellings(name: str) -> None:
    ran = run_verb("interface", "show", name)
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert lines[0] == "geometry_msgs/Twist"
    assert lines[1].startswith("# Velocity: linear in m/s")
    assert "# topics: cmd_vel" in lines
    assert [line.split()[:2] for line in lines if not line.startswith("#")][1:3] == [
        ["linear", "geometry_msgs/Vector3"],
        ["x", "float"],
    ]
    told = json.loads(run_verb("interface", "show", name, "--json").stdout)
    assert [each["name"] for each in told["fields"]] == ["linear", "angular"]


def test_a_request_is_shown_with_both_sides() -> None:
    ran = run_verb("interface", "show", "/sim/spawn")
    assert ran.returncode == 0, ran.stderr
    asks, replies = ran.stdout.split("---\n")
    assert "/sim/spawn: spawn a model" in asks
    assert "elea_msgs/SpawnModel" in asks
    assert replies.startswith("elea_msgs/ModelState")
    told = json.loads(run_verb("interface", "show", "sim/spawn", "--json").stdout)
    assert (told["asks"]["type"], told["replies"]["type"]) == ("elea_msgs/SpawnModel", "elea_msgs/ModelState")


def test_the_list_is_that_of_the_tables() -> None:
    told = json.loads(run_verb("interface", "list", "--json").stdout)
    assert [each["type"] for each in told["messages"]] == sorted(RECORDS)
    assert [each["name"] for each in told["requests"]] == [each.name for each in REQUESTS]
    text = run_verb("interface", "list", "nav_msgs", "--only-msgs").stdout
    assert "\n  nav_msgs/Odometry " in text
    assert "\n  nav_msgs/GridCells" in text, "a standard type without a record of ours"
    assert "Requests" not in text
    assert set(json.loads(run_verb("interface", "list", "--only-srvs", "--json").stdout)) == {"requests"}


def test_a_wrong_name_is_answered_with_the_nearest() -> None:
    for wrong, told in (
        ("geometry_msgs/Twsit", "did you mean 'geometry_msgs/Twist"),
        ("Odometry", "did you mean 'nav_msgs/Odometry'"),
        ("zzz", "./elea interface list shows all"),
    ):
        with pytest.raises(BadInput, match=f"unknown type '{wrong}'; {told}"):
            find_interface(wrong)
    with pytest.raises(BadInput, match="known: action_msgs, action_tutorials_interfaces"):
        list_types("zzz")
    ran = run_verb("interface", "show", "geometry_msgs/Twsit")
    assert (ran.returncode, ran.stdout) == (2, "")


def test_a_closed_pipe_ends_it_quietly() -> None:
    command = f"{sys.executable} -P -m deploy interface list | head -1"
    ran = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=180, check=False
    )
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "Messages:\n", "")
