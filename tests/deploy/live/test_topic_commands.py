"""How topic commands end: on Ctrl-C, a closed pipe, a full disk, a time-out, and bad input."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack

import pytest

from tests.harness.background_fleet import BackgroundFleet, external_publisher, interrupt
from tests.harness.cases import case
from tests.harness.waiting import wait_until


def test_ctrl_c_ends_it_with_a_last_word(running: BackgroundFleet) -> None:
    """The exit status shows whether everything requested was received."""
    verbs = {
        ("echo",): (0, "---"),
        ("hz",): (0, "lost: "),
        ("bw",): (0, "lost: "),
        ("delay",): (0, "window:"),
        ("hz", "-n", "100000"): (130, "lost: "),
    }
    with ExitStack() as stack:  # each prints something once a second
        started = {each: stack.enter_context(running.start("topic", *each, "/tb3_0/odom")) for each in verbs}
        for each, process in started.items():
            with case(*each):
                assert process.stdout is not None
                while process.stdout.readline() == "no new messages\n":
                    pass
                ended = interrupt(process)
                status, last = verbs[each]
                assert ended.status == status
                assert [line for line in ended.err.splitlines() if "lost" not in line] == []
                assert last in ended.out.splitlines()[-1]


@pytest.mark.parametrize("topic", ["/tb3_0/odom", "/tb3_0/robot_description"])
def test_a_closed_pipe_ends_it_quietly(running: BackgroundFleet, topic: str) -> None:
    """The second topic has no messages after its first: without them, nothing else would end the command."""
    line = f"{sys.executable} -P -m deploy topic echo --flow-style {topic} | head -n 1"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        env=running.command_line.environment,
        cwd=running.command_line.folder,
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert (done.returncode, done.stderr, done.stdout.count("\n")) == (0, "", 1)


def test_a_full_disk_is_told(running: BackgroundFleet) -> None:
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -P -m deploy topic echo /tb3_0/odom > /dev/full"],
        env=running.command_line.environment,
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert (done.returncode, done.stderr) == (1, "elea: the output cannot be written: No space left on device\n")


def test_waiting_for_a_topic(running: BackgroundFleet) -> None:
    with running.start("topic", "echo", "--wait", "--once", "/lab/later", "--json") as waiting:
        wait_until(lambda: "/_echo_" in running.run("node", "list", "-a").out, 20.0, "the echo in the graph")
        with external_publisher(running.endpoint, "lab/later", {"a": 1}):
            ended = running.command_line.finish(waiting)
    assert json.loads(ended.out) == {"a": 1}
    assert "/lab/later is not published yet: waiting" in ended.err
    silent = running.run("topic", "hz", "/tb3_0/cmd_vel", "--timeout", "1", status=1)
    assert "no message arrived on /tb3_0/cmd_vel within 1 s" in silent.err
    silent = running.run("topic", "echo", "--wait", "--once", "/lab/silent", "--timeout", "0.5", status=1)
    assert "0 messages arrived on /lab/silent within 0.5 s" in silent.err


def test_a_topic_that_is_not_there(running: BackgroundFleet) -> None:
    """Each command waits for it briefly."""
    with ExitStack() as stack:
        verbs = {
            each: stack.enter_context(running.start("topic", each, "/tb3_0/odm"))
            for each in ("echo", "hz", "type", "info")
        }
        for verb, process in verbs.items():
            with case(verb):
                ended = running.command_line.finish(process)
                assert (ended.status, ended.out) == (2, "")
                assert "no topic /tb3_0/odm is on the network; did you mean '/tb3_0/odom'?" in ended.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["echo", "/tb3_*/odom"], "wildcards are not allowed"),
        (["info", "/tb3_0//odom"], "parts are joined by a single '/'"),
        (["bw", "~odom"], "is private to a node"),
        (["echo", "/tb3_0/odom", "--field", "pose.poze"], "unknown field 'poze'; did you mean 'pose'"),
        (["echo", "/tb3_0/odom", "--field", "pose..x"], "is not a field path"),
        (["echo", "/tb3_0/odom/pose/poze"], "unknown field 'poze'"),
        (["echo", "/tb3_0/odom", "nav_msgs/Odometri"], "did you mean 'nav_msgs/Odometry'"),
        (["echo", "/tb3_0/odom", "--csv", "--json"], "exclude each other"),
        (["echo", "/tb3_0/odom", "--once", "-n", "2"], "exclude each other"),
        (["echo", "/tb3_0/odom", "-n", "0"], "x>=1"),
        (["hz", "/tb3_0/odom", "--window", "1"], "x>=2"),
        (["echo", "/tb3_0/odom", "--timeout", "0"], "x>0"),
        (["find", "geometry_msgs/Twits"], "did you mean 'geometry_msgs/Twist'"),
        (["ecoh", "/tb3_0/odom"], "unknown command 'ecoh'; did you mean 'echo'"),
        (["list", "--port", "1"], "no fleet is running on port 1"),
        (["list", "--connect", "tcp/127.0.0.1:1"], "no router at tcp/127.0.0.1:1"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input(running: BackgroundFleet, arguments: list[str], said: str) -> None:
    ended = running.run("topic", *arguments, status=2)
    assert said in ended.err
    assert ended.out == ""
