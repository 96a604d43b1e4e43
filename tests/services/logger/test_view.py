"""``./elea view RUN --picture`` as a user runs it: pictures of a fleet and of one robot, and rejected options."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from click.testing import CliRunner, Result

from deploy.commands.view import command
from messages.control import JointControllerState
from messages.geometry import Pose, PoseWithCovariance
from messages.nav import Odometry
from messages.sensor import JointState
from messages.std import Header, Time
from models.palette import COLOURS
from services.logger.columns import RobotColumns
from services.logger.recording import Recording
from services.logger.screenshots import robot_position, robot_radii
from services.runtime.errors import BadInput
from tests.services.logger.synthetic_drive import step_all, synthetic_fleet

LENGTH_S = 60.0
PLACE = (-2.2, 3.0)
UP, DOWN = 52.5, 57.5
"""Times [s] at which the arm is farthest to the right and to the left."""


def swing(now: int) -> float:
    """Return the arm's angle [deg] at a time [ns]."""
    return 60.0 * math.sin(math.tau * now / 1e10)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with four driving robots and a swinging arm."""
    folder = tmp_path_factory.mktemp("view")
    robots, columns = synthetic_fleet(), {name: RobotColumns() for name in (*synthetic_fleet(), "arm")}
    for name, robot in robots.items():
        columns[name].add_plan(robot.plan())
        columns[name].add_status(robot.status())
    crew = [*((name, "burger") for name in robots), ("arm", "arm")]
    with Recording(folder / "run.rrd", crew, (-3.0, -4.5, 5.5, 4.5), pytest.fail) as recording:
        for now in step_all(robots, LENGTH_S):
            for name, robot in robots.items():
                columns[name].add_truth([robot.truth()])
            header = Header(stamp=Time.of(now))
            columns["arm"].add_truth([Odometry(header=header, pose=PoseWithCovariance(pose=Pose.planar(*PLACE)))])
            angle = math.radians(swing(now))
            columns["arm"].add_joints([JointState(header=header, name=("bear_link",), position=(angle,))])
            told = JointControllerState(header=header, set_point=swing(now), process_value=swing(now))
            columns["arm"].add_control([told])
        recording.write({name: each.flush() for name, each in columns.items()}, last=True)
    return folder


def view(*arguments: object) -> Result:
    return CliRunner().invoke(command, list(map(str, arguments)))


@pytest.mark.process
def test_pictures_show_every_trail_and_the_arm(run: Path, tmp_path: Path) -> None:
    options = ("--picture", "--size", "1280x720", "--close", "arm", "--at", UP, "--at", DOWN, "-o", tmp_path)
    done = view(run, *options, "--json")
    assert done.exception is None, done.exception
    told = json.loads(done.output)
    names = [f"{name}-{at}s.png" for at in (UP, DOWN) for name in ("run", "run-arm")]
    assert told == {"recording": str(run / "run.rrd"), "pictures": [str(tmp_path / name) for name in names]}
    seen = {name: pixels(tmp_path / name) for name in names}
    assert {each.shape for each in seen.values()} == {(720, 1280, 3)}
    assert all((tmp_path / name).stat().st_size < 150_000 for name in names)
    world, plots = seen[f"run-{DOWN}s.png"][:, :660], seen[f"run-{DOWN}s.png"][:, 720:]
    for colour in COLOURS[1:5]:
        assert near(world, colour).sum() > 100, f"trail {colour}"
    assert near(plots, COLOURS[0]).sum() > 50, "the arm's angle"
    assert sum(near(plots, colour).sum() for colour in COLOURS[1:5]) > 150, "what the robots' plots show"
    right, left = (middle(seen[f"run-arm-{at}s.png"][:, :660]) for at in (UP, DOWN))
    assert right - left > 100, "from near by, it is seen to swing"


def middle(seen: np.ndarray) -> float:
    """Return the mean column [pixels] of the arm's rod, found by its shaded orange."""
    red, green, blue = (seen[:, :, channel] for channel in range(3))
    rod = (red > 110) & (red - blue > 60) & (red > green + 20) & (green > blue + 15)
    assert rod.sum() > 500
    return float(np.flatnonzero(rod.any(axis=0)).mean())


def pixels(png: Path) -> np.ndarray:
    return np.rint(matplotlib.image.imread(png)[:, :, :3] * 255).astype(int)


def near(seen: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    close: np.ndarray = np.abs(seen - np.array(colour)).max(axis=2) < 25
    return close


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--close", "arn"), r"unknown robot 'arn'; did you mean 'arm'\? \(known: arm, tb3_0, tb3_1, tb3_2, tb3_3\)"),
        (("--size", "wide"), r"--size 'wide': expected WIDTHxHEIGHT, each from 320 to 4096"),
        (("--size", "9999x900"), r"each from 320 to 4096 pixels"),
        (("--at", "nan"), r"--at nan: expected seconds of simulation time"),
        (("--at", "-1"), r"--at -1: expected seconds"),
    ],
)
def test_bad_wishes_are_refused(run: Path, tmp_path: Path, options: tuple[str, str], reason: str) -> None:
    done = view(run, "--picture", "-o", tmp_path, *options)
    assert isinstance(done.exception, BadInput)
    assert re.search(reason, str(done.exception)), done.exception
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_a_recording_is_told_from_a_folder_of_another_kind(tmp_path: Path) -> None:
    assert "is not a bag" in str(view(tmp_path).exception)
    (tmp_path / "processes.json").touch()
    assert "give its fleet a [[service]] of kind logger" in str(view(tmp_path).exception)


@pytest.mark.filterwarnings("error")
def test_where_a_robot_is_is_read_from_the_recording(run: Path) -> None:
    assert robot_position(run / "run.rrd", "arm", "sim_time", UP) == pytest.approx((*PLACE, 0.0))
    assert robot_position(run / "run.rrd", "tb3_3", "sim_time", 1.0)[1] == pytest.approx(1.5, abs=0.01)
    with pytest.raises(BadInput, match="the position of arm is not known at 0 s"):
        robot_position(run / "run.rrd", "arm", "sim_time", 0.0)
    assert robot_radii(run / "run.rrd") == pytest.approx({"arm": 0.0, **{f"tb3_{k}": 0.105 for k in range(4)}})
