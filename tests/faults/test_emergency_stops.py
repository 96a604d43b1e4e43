"""A user's emergency stop holds while the simulation, the panel or the tool dies and the controller drives on."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from messages.elea import EmergencyStop
from messages.requests import DELETE, LIST_STOPS, SPAWN, Name
from messages.simulation import SpawnModel
from messages.std import Empty
from services.panel.address import ADDRESS_FILE, read_address
from services.runtime.process import ROOT
from tests.faults.fleet_files import FLEET_HEADER, robot_table, waypoint_entry
from tests.faults.supervised_fleet import START_S, WITHIN_S, SupervisedFleet
from tests.faults.test_killed_processes import LANDING
from tests.harness.fork_server import ForkedVerb
from tests.harness.robot_recorder import STANDSTILL_SPEED
from tests.harness.waiting import wait_until
from tests.services.panel.page_client import page_client, send, wait_message

DESCRIPTION = (
    FLEET_HEADER.format(topology="direct")
    + robot_table(0, waypoint_entry(0))
    + robot_table(1, waypoint_entry(1))
    + '\n[[service]]\nkind = "sim"\nrestart = { first = 0.2, longest = 0.2 }\n'
    + '\n[[service]]\nkind = "panel"\nrestart = { first = 0.2 }\nparameters = { port = 0 }\n'
)
FREE = "tb3_1"
"""The robot that is never stopped; it shows that controllers drive and time runs."""
COMMANDED = 10
"""Number of commands at 25 Hz after which a robot without a stop would be at full speed."""


class EmergencyStopHarness:
    """Two robots at full speed, a page of the panel, and commands in a user's shell."""

    def __init__(self, fleet: SupervisedFleet) -> None:
        self.fleet, self.robot = fleet, fleet.robot("tb3_0")

    def page(self, on: bool, name: str = "/tb3_0") -> str:
        """Press STOP or reset of a robot on a page; return the answer."""
        address = wait_until(lambda: read_address(self.fleet.folder / "run" / ADDRESS_FILE), what="the panel's address")
        with page_client(address) as at:
            send(at, k="subscribe", channels=["robots"])
            wait_until(
                lambda: any(each["ns"] == name for each in wait_message(at, "robots")["robots"]),
                what=f"{name} on the page",
            )
            send(at, k="estop", id=1, robot=name, on=on)
            return str(wait_message(at, "reply")["result"])

    def shown(self) -> tuple[bool, bool]:
        """Return whether a new page shows the robot as stopped by this panel, and as stopped at all."""
        address = wait_until(lambda: read_address(self.fleet.folder / "run" / ADDRESS_FILE), what="the panel's address")
        with page_client(address) as at:
            send(at, k="subscribe", channels=["robots"])

            def told() -> dict[str, bool] | None:
                robots = wait_message(at, "robots")["robots"]
                return next((each for each in robots if each["ns"] == "/tb3_0" and each["stopped"]), None)

            found = wait_until(told, what="a robot that is stopped, on a page")
            return found["asked"], found["stopped"]

    def verb(self, *arguments: str) -> subprocess.Popen[str]:
        return ForkedVerb((*arguments, "--connect", self.fleet.endpoint), ROOT, os.environ)

    def do(self, *arguments: str) -> str:
        """Run a command to its end, assert success, and return its output."""
        ran = self.verb(*arguments)
        out, err = ran.communicate(timeout=60)
        assert ran.returncode == 0, out + err
        return out

    def stops(self) -> tuple[EmergencyStop, ...]:
        """Return the simulation's emergency stops."""
        return self.fleet.recorder.node.call(LIST_STOPS, Empty(), WITHIN_S).stops

    def wait_held(self, *holders: str) -> None:
        """Wait until exactly these holders, given by name prefix, stop the robot, and it stands still."""

        def held() -> bool:
            names = self.robot.base.stopped_by
            fits = len(names) == len(holders) and all(map(str.startswith, sorted(names), sorted(holders)))
            return (
                fits
                and self.robot.base.e_stopped == bool(holders)
                and (not holders or self.robot.speed < STANDSTILL_SPEED)
            )

        self.fleet.wait(held, f"a robot held by {holders}, not {self.robot.base.stopped_by}")

    def wait_driving(self) -> None:
        """Wait until no stop holds the robot and it drives again."""
        self.wait_held()
        self.fleet.wait(lambda: self.robot.speed > 0.1, "a robot that drives")

    def restart(self, name: str) -> int:
        """Kill a process; return when [ns] its successor was reported as started."""
        before = self.fleet.process(name)
        self.fleet.kill(name)
        return self.fleet.wait_restarted(before)

    def watch_it_stand(self, since: int) -> None:
        """Assert that it stands still after ``since`` [ns], while its controller commands it and the other one
        drives.
        """
        other, commands = self.fleet.robot(FREE), len(self.robot.command_instants)
        self.fleet.wait(
            lambda: (
                other.samples[-1].sent > since
                and other.speed > 0.1
                and len(self.robot.command_instants) > commands + COMMANDED
            ),
            "the other robot at speed, and a controller that drives this one",
        )
        moved = [each for each in self.robot.samples if each.sent > since and each.speed > LANDING]
        assert moved == []
        assert self.robot.base.e_stopped


@pytest.fixture(scope="module")
def fleet_with_stops(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmergencyStopHarness]:
    with SupervisedFleet(DESCRIPTION, 2, tmp_path_factory.mktemp("stops")) as fleet:
        fleet.wait_ready(within=START_S)
        fleet.wait_full_speed("tb3_0", FREE)
        yield EmergencyStopHarness(fleet)


def test_a_stop_from_the_panel_outlives_the_simulation_and_the_panel(fleet_with_stops: EmergencyStopHarness) -> None:
    fleet_with_stops.page(True)
    fleet_with_stops.wait_held("/panel")
    born = fleet_with_stops.restart("sim")
    fleet_with_stops.watch_it_stand(born)
    fleet_with_stops.wait_held("/panel")
    # Both at once: only the file still has the stop.
    fleet_with_stops.fleet.kill("panel")
    born = fleet_with_stops.restart("sim")
    fleet_with_stops.watch_it_stand(born)
    fleet_with_stops.fleet.wait_ready("panel")
    assert fleet_with_stops.shown() == (True, True), "the panel that returned knows that it was itself"
    fleet_with_stops.page(False)
    fleet_with_stops.wait_driving()


def test_a_stop_from_a_tool_outlives_it_and_holders_do_not_release_each_other(
    fleet_with_stops: EmergencyStopHarness,
) -> None:
    holding = fleet_with_stops.verb("topic", "pub", "/tb3_0/e_stop", "true")
    fleet_with_stops.wait_held("/_pub_")
    holding.kill()
    holding.communicate()
    born = fleet_with_stops.restart("sim")
    fleet_with_stops.watch_it_stand(born)
    fleet_with_stops.page(True)
    fleet_with_stops.wait_held("/_pub_", "/panel")
    fleet_with_stops.do("topic", "pub", "--once", "/tb3_0/e_stop", "false")
    fleet_with_stops.wait_held("/panel")
    fleet_with_stops.do("topic", "pub", "--once", "/tb3_0/e_stop", "true")
    fleet_with_stops.wait_held("/_pub_", "/panel")
    assert "may move when /_pub_" in fleet_with_stops.page(False)
    fleet_with_stops.wait_held("/_pub_")
    listed = fleet_with_stops.do("sim", "stops")
    assert "tb3_0" in listed
    assert "/_pub_" in listed
    assert "the stop of /_pub_" in fleet_with_stops.do("sim", "release", "tb3_0")
    fleet_with_stops.wait_driving()
    assert fleet_with_stops.do("sim", "stops") == "no robot is stopped\n"


def test_what_is_given_while_the_simulation_is_down_or_paused_counts(fleet_with_stops: EmergencyStopHarness) -> None:
    fleet_with_stops.do("sim", "pause")
    fleet_with_stops.do("topic", "pub", "--once", "--wall-time", "/e_stop", "true")
    wait_until(
        lambda: [each.robot for each in fleet_with_stops.stops()] == [""], what="a stop of all that counts in a pause"
    )
    born = fleet_with_stops.restart("sim")
    fleet_with_stops.fleet.wait(lambda: fleet_with_stops.robot.samples[-1].sent > born, "the new simulation")
    fleet_with_stops.wait_held("/_pub_")
    assert [
        each for each in fleet_with_stops.fleet.robot(FREE).samples if each.sent > born and each.speed > LANDING
    ] == []
    assert "all robots: the stop of /_pub_" in fleet_with_stops.do("sim", "release", "--all")
    fleet_with_stops.wait_driving()


def test_a_deleted_robot_takes_its_stop_with_it(fleet_with_stops: EmergencyStopHarness) -> None:
    fleet_with_stops.page(True)
    fleet_with_stops.wait_held("/panel")
    place = fleet_with_stops.fleet.recorder.node.call(DELETE, Name(name="tb3_0"), WITHIN_S)
    assert place.text == "deleted tb3_0"
    assert fleet_with_stops.stops() == ()
    born = max(each.sent for each in fleet_with_stops.robot.samples)
    fleet_with_stops.fleet.recorder.node.call(SPAWN, SpawnModel(name="tb3_0", model="burger"), WITHIN_S)
    fleet_with_stops.fleet.wait(lambda: fleet_with_stops.robot.samples[-1].sent > born, "the robot of the same name")
    fleet_with_stops.wait_driving()


def test_a_file_that_cannot_be_written_or_read(fleet_with_stops: EmergencyStopHarness) -> None:
    run = Path(fleet_with_stops.fleet.folder) / "run"
    file = run / "stops.json"
    beside = run / f".stops.json.{fleet_with_stops.fleet.process('sim').pid}"
    beside.mkdir()  # the simulation can't write a new file, as on a full disk
    (beside / "full").touch()
    fleet_with_stops.page(True)
    fleet_with_stops.wait_held("/panel")
    fleet_with_stops.fleet.wait(
        lambda: "emergency stops cannot be written" in fleet_with_stops.fleet.log("sim"), "the trouble in the log"
    )
    assert not file.exists() or "/panel" not in file.read_text()
    (beside / "full").unlink()
    beside.rmdir()
    fleet_with_stops.fleet.wait(
        lambda: file.exists() and "/panel" in file.read_text(), "the stop in the file, once there is room"
    )

    file.write_text("{")
    born = fleet_with_stops.restart("sim")
    fleet_with_stops.wait_held("/panel", "(damaged file)")
    assert psutil.pid_exists(fleet_with_stops.fleet.process("sim").pid)
    assert [
        each for each in fleet_with_stops.fleet.robot(FREE).samples if each.sent > born and each.speed > LANDING
    ] == []
    assert "all robots are stopped" in fleet_with_stops.fleet.log("sim")
    fleet_with_stops.page(False)
    fleet_with_stops.do("sim", "release", "--all")
    fleet_with_stops.wait_driving()
