"""Live parameters of a whole fleet in real processes: applied, saved, restored, rejected, and repeatable."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from messages.gazebo import JointName
from messages.parameters import HistoryOf, ParameterValues
from messages.requests import (
    JOINT_PROPERTIES,
    PARAMS_HISTORY,
    SET_DRIVE,
    SUPERVISOR_RESTART,
    WORLD_PROPERTIES,
    Name,
)
from messages.simulation import DriveSettings
from messages.std import Empty
from messages.topics import PLAN, UPDATES
from services.runtime.errors import CallFailed
from tests.harness.command_line import CommandLine
from tests.harness.ports import free_port
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.system.parameter_client import WITHIN_S, ParameterClient, parameter_client

PILOT, BASE, SQUARE, JOINTS = "/r/waypoint", "/r/base", "/s/square", "/arm/joints"

FLEET = """
name = "tuned"
[run]
mode = "{mode}"
ends = "{ends}"
duration = {duration}
[[robot]]
name = "r"
model = "burger"
parameters = {{ cmd_vel_timeout = 0.4 }}
services = [{{ kind = "waypoint", parameters = {{ goals = [[100, 0]], max_linear = 0.2 }} }}]
[[robot]]
name = "s"
model = "p3dx"
pose = {{ x = 0, y = 5 }}
services = [{{ kind = "square", parameters = {{ side = 50, linear_speed = 0.2, log = "" }} }}]
[[robot]]
name = "arm"
model = "arm"
pose = {{ x = 0, y = -5 }}
"""
CHANGES = """
[[change]]
at = 1.5
set = "/r/waypoint"
values = { max_linear = 0.1 }
[[change]]
at = 2.0
set = "/r/base"
values = { "linear.max_velocity" = 0.05 }
[[change]]
at = 2.0
set = "/arm/joints"
values = { damping = 5.0 }
"""


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[CommandLine]:
    terminal = CommandLine(tmp_path)
    yield terminal
    terminal.run("down")


def fleet(folder: Path, mode: str, ends: str, duration: float = 0, changes: str = "") -> str:
    path = folder / "tuned.toml"
    path.write_text(FLEET.format(mode=mode, ends=ends, duration=duration) + changes)
    return str(path)


def processes(results: Path) -> dict[str, int]:
    state = json.loads((results / "processes.json").read_text())
    return {each["name"]: each["pid"] for each in state["processes"]}


def log(results: Path) -> str:
    """Return the waypoint service's log."""
    file = results / "logs" / "r.waypoint.log"
    return file.read_text() if file.exists() else ""


def test_a_fleet_is_tuned_while_it_drives_and_keeps_what_was_saved(terminal: CommandLine) -> None:
    file, results = fleet(terminal.folder, "real", "never"), terminal.folder / "results"
    started = terminal.run_fleet(file, results, "--detach")
    assert started.status == 0, started.err
    with parameter_client(terminal.port) as t:
        assert t.get(PILOT)["max_linear"] == (0.2, "fleet")
        assert t.get(BASE)["cmd_vel_timeout"] == (0.4, "fleet")
        assert t.get(BASE)["wheel_radius"] == (0.033, "default")
        t.wait_for_speed(0.2)
        t.set(PILOT, max_linear=0.1)
        t.wait_for_speed(0.1)
        t.set(PILOT, run=True, max_linear=0.15)
        t.wait_for_speed(0.15)

        # A restarted service gets the values of its run; a restarted parameter service gets them from the services.
        t.node.call(SUPERVISOR_RESTART, Name(name="r/waypoint"), WITHIN_S)
        wait_until(lambda: "max_linear = 0.15 (run)" in log(results), 30)
        t.wait_for_speed(0.15)
        psutil.Process(processes(results)["params"]).send_signal(signal.SIGKILL)
        wait_until(lambda: "the parameter service is gone" in log(results), 20)
        t.wait_for(PILOT, max_linear=(0.15, "run"))
        t.wait_for_speed(0.15)
        t.set(PILOT, max_linear=0.12)
        t.wait_for_speed(0.12)
        second = terminal.start("up", file, "--port", str(free_port()), "--report", str(terminal.folder / "second"))
        plans = t.node.subscribe(PLAN, "/r/plan")
        t.set(PILOT, run=True, goals=((50.0, 50.0), (0.0, 0.0)))
        wait_until(
            lambda: t.node.update_subscribers() or any(len(plan.poses) == 2 for plan, _ in plans.messages),
            20,
            "a new plan",
        )

        # A contradictory change is undone for all subscribers; no value of a foreign node is applied.
        for wrong, says in (({"linear__min_velocity": 0.1}, "out of bounds"), ({"wheel_pid__p": 1.0}, "cannot change")):
            with pytest.raises(CallFailed, match=says):
                t.set(BASE, **wrong)
        t.set(BASE, linear__max_deceleration=0.0)
        t.wait_for(BASE, **{"linear.max_deceleration": (None, "default")})
        newest = t.node.call(PARAMS_HISTORY, HistoryOf(set=BASE, limit=1), WITHIN_S).changes[0]
        assert newest.kind == "undo"
        assert "could never change its speed" in newest.who
        t.node.advertise(UPDATES, f"{PILOT}/parameter_updates").publish(
            ParameterValues(set=PILOT, revision=999, values=())
        )
        wait_until(lambda: t.rejected_samples(PILOT, f"{PILOT}/parameter_updates"), 10)

        # A base's values have one owner, whichever request changes them.
        t.node.call(SET_DRIVE, DriveSettings(name="r", wheel_separation_multiplier=1.1), WITHIN_S)
        t.wait_for(BASE, wheel_separation_multiplier=(1.1, "run"))
        t.set(BASE, run=True, wheel_separation_multiplier=1.2)
        wait_until(
            lambda: t.node.call(SET_DRIVE, DriveSettings(name="r"), WITHIN_S).wheel_separation_multiplier == 1.2,
            10,
            "the base's multiplier",
        )
        with pytest.raises(CallFailed, match="cannot change while"):
            t.set(BASE, wheel_radius=0.1)

        # A square continues at another speed, an arm's joint friction rises, and time runs slower.
        t.wait_for_speed(0.2, "s", within=0.02)
        t.set(SQUARE, linear_speed=0.4)
        t.wait_for_speed(0.4, "s", within=0.02)
        with pytest.raises(CallFailed, match="side cannot change while"):
            t.set(SQUARE, side=2.0)
        assert t.get(JOINTS)["damping"] == (0.0, "default")
        t.set(JOINTS, run=True, damping=5.0, effort_mode="sum")
        asked = JointName(model="arm", joint_name="bear_link")
        wait_until(lambda: t.node.call(JOINT_PROPERTIES, asked, WITHIN_S).damping == 5.0, 10, "damping of the joint")
        t.set("/sim", run=True, factor=0.25)
        wait_until(lambda: t.node.call(WORLD_PROPERTIES, Empty(), WITHIN_S).factor == 0.25, 10, "the factor of time")
        assert t.wall_time_of(0.2) > 0.15 / 0.25, "four seconds of the wall for one of the simulation"
    refused = terminal.finish(second)
    assert refused.status == 2
    assert f"the fleet tuned (port {terminal.port}) uses the file of parameters" in refused.err
    assert f"./elea down --port {terminal.port}, give this fleet a file of its own with --params FILE" in refused.err
    assert list((terminal.folder / "second" / "logs").iterdir()) == [], "nothing was started"
    terminal.run("down")
    note = "/r/waypoint max_linear = 0.12 (saved; the fleet's is 0.2)"
    report = json.loads((results / "report.json").read_text())
    assert any(note in each for each in report["notes"])
    assert report["parameters"][BASE]["wheel_separation_multiplier"] == {"value": 1.2, "origin": "run"}

    again = terminal.run_fleet(file, terminal.folder / "again", "--detach")
    assert again.status == 0, again.err
    with parameter_client(terminal.port) as t:
        assert t.get(PILOT)["max_linear"] == (0.12, "saved")
        assert t.get(BASE)["wheel_separation_multiplier"] == (1.0, "default")
        t.wait_for_speed(0.12)
    terminal.run("down")
    told = (terminal.folder / "again" / "supervisor.log").read_text()
    assert f"saved parameters override the fleet file: {note}; --no-saved ignores them" in told
    assert [each.name for each in (terminal.folder / "params").glob("*.db")] == ["tuned.db"]


def test_a_run_in_lockstep_repeats_with_its_changes_and_without_what_is_saved(terminal: CommandLine) -> None:
    file = fleet(terminal.folder, "lockstep", "duration", 3, CHANGES)
    reports = []
    for number, options in enumerate((["--no-saved"], ["--params", "own.db"])):
        ended = terminal.run_fleet(file, terminal.folder / str(number), "--json", *options)
        reports.append(json.loads(ended.out))
    one, other = reports
    assert one["run"]["trajectory_hash"] == other["run"]["trajectory_hash"]
    assert one["parameters"] == other["parameters"]
    assert one["parameters"][PILOT]["max_linear"] == {"value": 0.1, "origin": "run"}
    assert one["parameters"][JOINTS] == {"damping": {"value": 5.0, "origin": "run"}}
    assert one["notes"] == other["notes"]
    assert [each for each in one["notes"] if not each.startswith("Odometry")] == []
    # 0.2 m/s until 1.5 s, 0.1 m/s until 2 s, then 0.05 m/s; less the acceleration phase.
    assert 0.34 < one["robots"]["r"]["path_length_m"] < 0.39
    assert (terminal.folder / "own.db").exists()
    assert not (terminal.folder / "params").exists()


def test_a_damaged_file_ends_the_start_with_its_reason_on_the_terminal_and_stays_as_it_is(
    terminal: CommandLine,
) -> None:
    damaged = terminal.folder / "damaged.db"
    damaged.write_bytes(b"SQLite format 3\0" + b"x" * 4000)
    ended = terminal.run_fleet(
        fleet(terminal.folder, "lockstep", "duration", 6), terminal.folder / "no", "--params", "damaged.db"
    )
    assert ended.status == 1
    assert ended.err.count(f"{damaged} is a database of another program") == 1
    assert "it was left as it is" in ended.err
    assert "the fleet ended: params failed" in ended.err
    assert damaged.read_bytes() == b"SQLite format 3\0" + b"x" * 4000


def test_a_service_starts_without_the_parameter_service_and_follows_it_when_it_comes(tmp_path: Path) -> None:
    with Network(tmp_path) as network:
        waypoint = network.start("waypoint", "--namespace", "r", "--fleet-param", "max_linear=0.2")
        wait_until(lambda: "no parameter service is visible" in waypoint.text, 20, "the word of the waypoint service")
        params = network.start("params")
        wait_until(lambda: "the parameter service is visible: following it" in waypoint.text, 20)
        with network.node("tuner") as node:
            t = ParameterClient(node)
            t.wait_for(PILOT, max_linear=(0.2, "fleet"))
        assert waypoint.text.count("parameter service") == 2
        assert params.stop() == 0
        wait_until(lambda: "the parameter service is gone: keeping the current values" in waypoint.text, 20)
        assert waypoint.status is None
