"""The square in real processes: graded in lockstep; stopped by a signal, by lost odometry, by a bad log file."""

from __future__ import annotations

import csv
import json
import math
import signal
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jsonschema
import matplotlib.image
import pytest

from deploy.fleet_file import find_fleet
from deploy.report.record import SCHEMA_FILE
from messages.geometry import STOP
from messages.nav import Odometry
from messages.topics import CMD_VEL, ODOM, STATUS
from services.runtime.node import Node
from services.square import LOG_FILE
from services.square.csv_log import COLUMNS
from tests.harness.cases import case
from tests.harness.command_line import CommandLine, CommandResult
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, distance, speed, time_of
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until
from tests.system.short_fleets import without_logger

DRIVE = {"ramp": "base", "linear": {"max_acceleration": 0.3}, "angular": {"max_acceleration": 1.745329}}
"""The tutorial's limits [m/s2, rad/s2]."""
SHORT = {"side": 0.5, "angular_speed": 1.5}
"""The square in MuJoCo: 22 s of simulation time, instead of 38 s."""
PATIENCE_S = 5.0
"""Command time-out [s] of a base that its square must stop: long enough that a busy machine doesn't trigger it."""
LATE_S = 3.0
"""Time [s] by which a square may notice late that it has no odometry, on a busy machine; well below PATIENCE_S."""


class Run:
    """A complete run of a fleet, in a folder of its own, with ``parameters`` of its square; only the first is
    recorded.
    """

    def __init__(self, folder: Path, name: str, *options: str, parameters: Mapping[str, float] | None = None) -> None:
        self.results = folder / "results"
        folder.mkdir()
        terminal, picture = CommandLine(folder), folder.name == "first"
        fleet: str | Path = name
        if not picture:
            fleet = folder / f"{name}.toml"
            text, own = without_logger(find_fleet(name)), 'kind = "square"'
            assert text.count(own) == 1
            given = ", ".join(f"{each} = {value}" for each, value in (parameters or {}).items())
            fleet.write_text(text.replace(own, f"{own}, parameters = {{ {given} }}" if given else own))
        self.ended: CommandResult = terminal.run_fleet(fleet, self.results, "--json", *options, picture=picture)
        assert self.ended.out, self.ended.err
        self.report: dict[str, Any] = json.loads(self.ended.out)
        self.robot: dict[str, Any] = self.report["robots"]["RosAria"]

    @property
    def log(self) -> bytes:
        """The square's CSV."""
        return (self.results / LOG_FILE).read_bytes()


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, Future[Run]]]:
    """All runs in parallel, as each mostly waits while it starts and ends."""
    folder = tmp_path_factory.mktemp("square")
    with ThreadPoolExecutor(3) as pool:
        yield {
            "first": pool.submit(Run, folder / "first", "square"),
            "mujoco": pool.submit(Run, folder / "mujoco", "square", "--engine", "mujoco", parameters=SHORT),
            "tutorial": pool.submit(Run, folder / "tutorial", "square_tutorial"),
        }


@pytest.fixture(scope="module")
def square(runs: Mapping[str, Future[Run]]) -> Run:
    return runs["first"].result()


@pytest.fixture(scope="module")
def tutorial(runs: Mapping[str, Future[Run]]) -> Run:
    return runs["tutorial"].result()


def test_it_closes_on_ground_truth(square: Run) -> None:
    closes(square, 1.0)


def closes(run: Run, side: float) -> None:
    """Assert that a run drove all four sides, and that its odometry and square are exact."""
    assert run.ended.status == 0, run.ended.err
    robot = run.robot
    assert robot["closure_m"] < 0.002
    assert robot["closure_heading_deg"] < 0.3
    assert robot["odometry_error_max_m"] < 0.001
    assert robot["odometry_heading_error_max_deg"] < 0.1
    assert len(robot["corners"]) == 4
    for corner in robot["corners"]:
        assert corner["true_m"] < 0.003
        assert abs(corner["true_deg"]) < 0.3
        assert abs(corner["true_m"] - corner["odometry_m"]) < 0.001
    assert (robot["points_reached"], robot["collisions"], robot["commands_timed_out"]) == (4, 0, 0)
    assert 3.9 * side < robot["path_length_m"] < 4.1 * side


def test_it_closes_in_mujoco_as_well(runs: Mapping[str, Future[Run]]) -> None:
    run = runs["mujoco"].result()
    assert run.report["run"]["engine"] == "mujoco"
    closes(run, SHORT["side"])


def test_its_report_fits_the_schema_and_has_a_picture(square: Run) -> None:
    jsonschema.validate(square.report, json.loads(SCHEMA_FILE.read_text()))
    assert square.report["notes"] == []
    assert matplotlib.image.imread(square.results / "report.png").std() > 0.05


def test_its_log_has_the_columns_of_the_tutorial_and_the_truth_beside_them(square: Run) -> None:
    rows = list(csv.DictReader(square.log.decode().splitlines()))
    assert tuple(rows[0]) == COLUMNS
    times = [float(row["time"]) for row in rows]
    assert times == pytest.approx([0.1 * number for number in range(len(rows))])
    assert 330 < len(rows) < 420
    for row in rows:
        desired, actual, truth = (
            [float(row[f"{kind}_{axis}"]) for axis in "xy"] for kind in ("desired", "actual", "truth")
        )
        assert math.dist(desired, actual) < 0.02
        assert math.dist(actual, truth) < 0.001
        assert float(row["error"]) == pytest.approx(math.dist(desired, truth), abs=1e-12)
        assert float(row["drift"]) == pytest.approx(math.dist(actual, truth), abs=1e-12)
    assert {row["doing"] for row in rows} == {"drive", "turn"}
    assert rows[-1]["corner"] == "3"


def test_the_law_of_the_tutorial_misses_as_computed_and_the_report_says_why(tutorial: Run) -> None:
    assert tutorial.ended.status == 0, tutorial.ended.err
    robot = tutorial.robot
    assert 0.2 < robot["closure_m"] < 0.24
    assert 17 < robot["closure_heading_deg"] < 19
    turned = [corner["true_deg"] for corner in robot["corners"]]
    assert turned == pytest.approx([0.3, 4.8, 9.4, 13.9], abs=2.0)
    assert robot["odometry_error_max_m"] < 0.001, "its odometry is not to blame"
    assert robot["closure_odometry_heading_deg"] == pytest.approx(robot["closure_heading_deg"], abs=0.05)
    (note,) = tutorial.report["notes"]
    assert "inaccurate by design" in note
    assert "would end 0.223 m and 18.2 deg" in note
    assert robot["closure_m"] == pytest.approx(0.223, abs=0.003)
    assert robot["closure_heading_deg"] == pytest.approx(18.2, abs=0.2)


def test_the_log_of_the_tutorials_law_shows_its_states(tutorial: Run) -> None:
    rows = list(csv.DictReader(tutorial.log.decode().splitlines()))
    assert {row["doing"] for row in rows} == {"MOVE_FORWARD", "ROTATE", "done"}
    assert math.degrees(float(rows[-1]["actual_yaw"])) == pytest.approx(18.1, abs=0.3)


class Pioneer:
    """A Pioneer in real time, its ground truth and commands; the test starts the square."""

    def __init__(self, network: Network, node: Node) -> None:
        self.network, self.node = network, node
        self.truth = GroundTruthRecorder(node, "RosAria")
        self.commands = MessageRecorder(node.subscribe(CMD_VEL, "/RosAria/cmd_vel"))
        self.status = MessageRecorder(node.subscribe(STATUS, "/RosAria/status"))
        wait_until(self.truth.received, 30.0, "ground truth")

    def square(self, *arguments: str, log: str = "") -> Process:
        return self.network.start("square", "--namespace", "RosAria", "--param", f"log={log}", *arguments)

    def until_cruising(self) -> Odometry:
        """Wait until it moves at the square's speed and return that sample."""
        wait_until(lambda: speed(self.truth.wait_next()) > 0.199, WITHIN_S, "0.2 m/s")
        return self.truth.received()[-1]

    def until_rest(self, since: Odometry) -> Odometry:
        """Wait for the first sample at rest after ``since`` and return it."""

        def rested() -> Odometry | None:
            after = (each for each in self.truth.received() if time_of(each) > time_of(since))
            return next((each for each in after if abs(speed(each)) < 1e-3), None)

        found = wait_until(rested, WITHIN_S, "rest")
        assert found is not None
        return found


@pytest.fixture(scope="module")
def pioneer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pioneer]:
    robots = [{"name": "RosAria", "model": "p3dx", "parameters": {**DRIVE, "cmd_vel_timeout": PATIENCE_S}}]
    with Network(tmp_path_factory.mktemp("pioneer")) as network:
        network.start("sim", "--param", f"robots={json.dumps(robots)}", "--param", "mode=real")
        with network.node() as node:
            yield Pioneer(network, node)


def test_sigint_stops_the_robot_and_leaves_a_whole_log(pioneer: Pioneer, tmp_path: Path) -> None:
    log = tmp_path / "mine.csv"
    square = pioneer.square(log=str(log))
    cruising = pioneer.until_cruising()
    wait_until(lambda: len(log.read_text().splitlines()) > 5, WITHIN_S, "rows in its log")
    square.signal(signal.SIGINT)
    assert square.wait() == 0, square.text
    before = pioneer.truth.received()[-1]
    rest = pioneer.until_rest(cruising)
    driven = [each for each in pioneer.truth.received() if time_of(each) < time_of(rest)]
    moving = [each for each in driven if speed(each) > 0.199][-1]
    wait_until(lambda: pioneer.commands.received()[-1] == STOP, WITHIN_S, "its last command")
    assert time_of(rest) - time_of(moving) < 0.2 / 0.3 + 0.1
    assert distance(rest, moving) < 0.2**2 / 0.6 + 0.02
    later = pioneer.truth.wait_after(0.5)
    assert distance(rest, later) < 1e-3
    assert time_of(before) <= time_of(later)
    lines = log.read_text().splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert len(lines) > 5
    assert all(line.count(",") == len(COLUMNS) - 1 for line in lines)


def test_loss_of_odometry_stops_the_robot_until_it_is_back(pioneer: Pioneer) -> None:
    """The test relays the base's odometry to the square, and then stops."""
    source = MessageRecorder(pioneer.node.subscribe(ODOM, "/RosAria/odom"))
    relay = pioneer.node.advertise(ODOM, "/RosAria/relayed")
    passed = 0

    def pass_on() -> None:
        nonlocal passed
        samples = source.received()
        for each in samples[passed:]:
            relay.publish(each)
        passed = len(samples)

    def cruising() -> bool:
        pass_on()
        return speed(pioneer.truth.received()[-1]) > 0.199

    square = pioneer.square("--remap", "odom:=relayed")
    wait_until(cruising, WITHIN_S, "0.2 m/s")
    last = source.received()[passed - 1]
    rest = pioneer.until_rest(last)
    assert 0.5 < time_of(rest) - time_of(last) < 0.5 + 0.2 / 0.3 + LATE_S
    wait_until(lambda: pioneer.status.received()[-1].state == "waiting", WITHIN_S, "the square's word")
    wait_until(lambda: "no odometry on /RosAria/odom" in square.text, WITHIN_S, "its complaint")
    assert distance(rest, pioneer.truth.wait_after(0.5)) < 1e-3
    passed = len(source.received())
    wait_until(cruising, WITHIN_S, "0.2 m/s again")
    wait_until(lambda: pioneer.status.received()[-1].state == "driving", WITHIN_S, "the square's word that it drives")
    assert square.status is None
    square.stop()


def test_without_odometry_from_the_start_it_waits(pioneer: Pioneer) -> None:
    square = pioneer.network.start("square", "--namespace", "nobody", "--param", "log=")
    wait_until(lambda: "no odometry on /nobody/odom" in square.text, 30.0, "its complaint")
    assert square.status is None
    square.stop()


def test_a_log_that_cannot_be_written_is_told_before_anything_moves(pioneer: Pioneer, tmp_path: Path) -> None:
    for log in ("missing/square.csv", "."):
        with case(log):
            square = pioneer.network.start("square", "--param", f"log={tmp_path / log}")
            assert square.wait() == 2
            assert f"the log {tmp_path / log}".removesuffix("/.") in square.text
            assert "choose another path with the parameter log" in square.text
            assert "Traceback" not in square.text
