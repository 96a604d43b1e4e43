"""``tf tree`` and ``tf echo`` on a running simulation."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations, pairwise
from pathlib import Path
from statistics import median

import pytest

from messages.geometry import Pose, TransformStamped
from messages.requests import SET_STATE
from messages.se3 import Pose3
from messages.simulation import SetModelState
from messages.std import Header
from messages.tf import TFMessage
from messages.topics import TF_STATIC
from services.runtime.process import ROOT
from tests.harness.fork_server import run_verb
from tests.harness.ports import free_port
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.services.state.conftest import TfHarness

pytestmark = pytest.mark.waits

BURGER_FRAMES, GRIPPER_FRAMES = 8, 8
FRAMES = 1 + 2 * BURGER_FRAMES + GRIPPER_FRAMES
WITHIN_S = 60.0
"""Wall time limit for what is known to a command once every node of the scene had a processor while it listened."""
PATIENT = ("--timeout", "50")
"""An end to what hangs; the default of 3 s may pass while a node of the scene waits for a processor."""
PERIOD_NS = 100_000_000
"""Of the gripper's moving frames."""


def test_the_tree_shows_who_tells_of_what_and_how_often_and_is_drawn(scene: TfHarness) -> None:
    stamps: list[int] = []

    def whole() -> list[subprocess.CompletedProcess[str]]:
        """Run both; return nothing if a node sent nothing, or a single transform, while they listened."""
        ran, drawn = scene.run_together(("tf", "tree", "--json", "--listen", "2"), ("tf", "tree"))
        rows = json.loads(ran.stdout)["frames"] if ran.stdout else []
        moving = [each for each in rows if each["parent"] is not None and not each["static"]]
        seen = len(rows) == len(drawn.stdout.splitlines()) == FRAMES and "  once, " not in drawn.stdout
        return [ran, drawn] if seen and all(each["rate"] is not None for each in moving) else []

    scene.poll()
    with ThreadPoolExecutor(1) as pool:
        both = pool.submit(wait_until, whole, WITHIN_S, "trees with all frames")
        wait_until(lambda: stamps.extend(scene.stamps("gripper/arm")) or both.done(), 2 * WITHIN_S)
    stamps += scene.stamps("gripper/arm")
    ran, drawn = both.result()
    assert (ran.returncode, ran.stderr) == (0, "")
    told = json.loads(ran.stdout)
    frames = {each["frame"]: each for each in told["frames"]}
    assert told["faults"] == []
    assert told["time"] > 0
    assert frames["world"]["parent"] is None
    base = frames["a/base_footprint"]
    assert (base["parent"], base["static"], base["publishers"]) == ("a/odom", False, ["/sim"])
    assert base["rate"] == 25
    assert 0 <= base["age"] < 0.5
    link = frames["a/base_link"]
    assert (link["static"], link["publishers"], link["rate"], link["age"]) == (True, ["/a/state"], None, None)
    assert frames["a/wheel_left_link"]["publishers"] == ["/a/state"]
    assert frames["b/wheel_left_link"]["publishers"] == ["/sim"]
    assert frames["gripper/arm"]["publishers"] == ["/gripper/state"]
    assert frames["gripper/arm"]["rate"] in possible_rates(stamps)
    gaps = [later // PERIOD_NS - earlier // PERIOD_NS for earlier, later in pairwise(stamps)]
    assert (min(gaps), median(gaps)) == (1, 1), "one in each period, but for those that a busy machine skips"
    assert frames["eye"]["parent"] == "gripper/hand"

    assert drawn.returncode == 0, drawn.stderr
    lines = drawn.stdout.splitlines()
    assert [line for line in lines if not line.startswith((" ", "├", "│", "└"))] == ["gripper/base", "world"]
    assert "├── a/odom  static, /sim" in lines
    assert any(line.startswith("│   └── a/base_footprint  25 Hz, ") for line in lines)
    assert len(lines) == len(set(lines)) == FRAMES


def possible_rates(stamps: Sequence[int]) -> set[float]:
    """Return the rates [Hz] over all spans: about 10, and less where a busy machine cost the node a tick."""
    return {
        round((end - begin) * 1e9 / (stamps[end] - stamps[begin]), 3)
        for begin, end in combinations(range(len(stamps)), 2)
        if stamps[end] > stamps[begin]
    }


def test_where_a_frame_is(scene: TfHarness) -> None:
    half = math.pi / 4
    pose = Pose.planar(1.0, 2.0, 2 * half)
    scene.node.call(SET_STATE, SetModelState(name="b", pose=pose), WITHIN_S)
    ran = scene.run_command("tf", "echo", "b/base_link", "b/base_scan", "--once", "--json", *PATIENT)
    assert ran.returncode == 0, ran.stderr
    told = json.loads(ran.stdout)
    assert (told["source"], told["target"], told["time"], told["age"]) == ("b/base_link", "b/base_scan", None, None)
    assert told["translation"] == pytest.approx({"x": -0.032, "y": 0.0, "z": 0.172})
    assert told["quaternion"] == pytest.approx({"x": 0, "y": 0, "z": 0, "w": 1})

    def turned() -> bool:
        shown = scene.run_command("tf", "echo", "world", "b/base_footprint", "--once", "--json", *PATIENT).stdout
        moved = json.loads(shown)
        return bool(abs(moved["rpy"][2] - 2 * half) < 0.01 and abs(moved["rpy_degrees"][2] - 90) < 1)

    wait_until(turned, 30.0, "the robot where it was put")


def test_it_is_shown_as_text_and_the_inverse_too(scene: TfHarness) -> None:
    ran = scene.run_command("tf", "echo", "gripper/arm", "gripper/post", "-n", "2", "-r", "20", *PATIENT)
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert len(lines) == 10
    assert lines[0].startswith("gripper/post in gripper/arm, at ")
    assert lines[1:5] == [
        "- translation [m]: [0.0000, 0.0000, -0.1000]",
        "- quaternion (x, y, z, w): [0.0000, 0.0000, 0.0000, 1.0000]",
        "- rpy [rad]: [0.0000, 0.0000, 0.0000]",
        "- rpy [deg]: [0.00, 0.00, 0.00]",
    ]


def test_the_rate_is_in_simulation_time(scene: TfHarness) -> None:
    ran = scene.run_command("tf", "echo", "world", "a/base_link", "-n", "9", "--rate", "5", "--json", *PATIENT)
    assert ran.returncode == 0, ran.stderr
    answers = [json.loads(line) for line in ran.stdout.splitlines()]
    assert len(answers) == 9
    periods = [math.floor((each["time"] + each["age"]) * 5 + 1e-6) for each in answers]
    gaps = [later - earlier for earlier, later in pairwise(periods)]
    # A transform may arrive before the clock of its time: then the one of the next period is shown early.
    assert min(gaps) >= 0, answers
    assert median(gaps) == 1, "a busy machine skips a period of 0.2 s now and then"


def test_why_it_cannot_be_told(scene: TfHarness) -> None:
    reasons = {
        "a/base_lnk": "frame 'a/base_lnk' is unknown; did you mean 'a/base_link'",
        "gripper/arm": "they are in two trees: 'world' with a/base_footprint",
    }

    def told() -> bool:
        """Ask for both; return whether what the reasons name was known in time."""
        all_ran = scene.run_together(*(("tf", "echo", "world", target, "--timeout", "1") for target in reasons))
        assert [(each.returncode, each.stdout) for each in all_ran] == [(1, "")] * len(reasons)
        return all(reason in each.stderr for reason, each in zip(reasons.values(), all_ran, strict=True))

    wait_until(told, WITHIN_S, "both reasons")


def test_a_closed_pipe_ends_it_quietly(scene: TfHarness) -> None:
    command = (
        f"{sys.executable} -P -m deploy tf echo world a/base_link -r 50 {' '.join(PATIENT)} "
        f"--connect {scene.network.endpoint} | head -1"
    )
    ran = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.startswith("a/base_link in world, at ")


def test_an_interrupt_ends_it(scene: TfHarness) -> None:
    process = subprocess.Popen(
        [
            sys.executable,
            "-P",
            "-m",
            "deploy",
            "tf",
            "echo",
            "world",
            "a/base_link",
            *PATIENT,
            "--connect",
            scene.network.endpoint,
        ],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=WITHIN_S)
    assert (process.returncode, said) == (0, "")


def test_a_circle_is_no_tree(tmp_path: Path) -> None:
    with Network(tmp_path) as network, network.node("twister") as node:
        empty = run_verb("tf", "tree", "--listen", "0.3", "--connect", network.endpoint)
        assert empty.returncode == 1
        assert "no frames on /tf or /tf_static within" in empty.stderr
        pairs = [("p", "q"), ("q", "r"), ("r", "p")]
        transforms = [
            TransformStamped(header=Header(frame_id=parent), child_frame_id=child, transform=Pose3().to_transform())
            for parent, child in pairs
        ]
        node.advertise(TF_STATIC).publish(TFMessage(transforms=tuple(transforms)))

        def told() -> list[subprocess.CompletedProcess[str]]:
            """Run both; return nothing if the frames came to one of them too late."""
            with ThreadPoolExecutor() as pool:
                words = ("tf", "tree", "--listen", "1"), ("tf", "echo", "p", "q", "--timeout", "1")
                ran, echoed = pool.map(lambda each: run_verb(*each, "--connect", network.endpoint), words)
            assert (ran.returncode, echoed.returncode) == (1, 1)
            return [ran] if ran.stdout and "in a loop" in echoed.stderr else []

        [ran] = wait_until(told, WITHIN_S, "the frames in both")
        assert "frames in a loop: p in r in q in p" in ran.stderr
        assert "p in r  static, /twister, in a loop" in ran.stdout


def test_nobody_there_is_told() -> None:
    ran = run_verb("tf", "tree", "--connect", f"tcp/127.0.0.1:{free_port()}")
    assert ran.returncode == 2
    assert "no router at" in ran.stderr
