"""The verbs that look at topics, on a running fleet."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
import time
from collections.abc import Iterator

import msgpack
import numpy as np
import pytest

from deploy.live.values import read_yaml
from messages.topics import ODOM
from tests.live.rig import Fleet, fleet, interrupt, sender
from tests.waiting import until

WEATHER = {
    "temperature": 20.5,
    "wind": [1, 2],
    "grid": msgpack.ExtType(1, msgpack.packb(["<i2", [2, 2], np.arange(4, dtype="<i2").tobytes()])),
}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    with fleet(tmp_path_factory.mktemp("idle")) as made:
        yield made


def test_list(running: Fleet) -> None:
    names = running.do("topic", "list").out.splitlines()
    assert {"/clock", "/tb3_0/odom", "/tb3_1/camera/image", "/rosout"} <= set(names)
    assert names == sorted(names)
    assert int(running.do("topic", "list", "-c").out) == len(names)
    assert "/tb3_0/odom [nav_msgs/Odometry]\n" in running.do("topic", "list", "-t").out
    shown = running.do("topic", "list", "-v").out
    assert "/tb3_0/odom [nav_msgs/Odometry, sensor, 25 Hz]\n  <- /sim\n  -> /grader\n" in shown
    told = {each["name"]: each for each in running.read("topic", "list")}
    assert list(told) == names
    odom = told["/tb3_0/odom"]
    assert (odom["types"], odom["quality"], odom["promised"]) == (["nav_msgs/Odometry"], "sensor", 25)
    assert (odom["publishers"], odom["about"]) == (["/sim"], ODOM.about)


def test_list_hears_who_declares_nothing(running: Fleet) -> None:
    with sender(running.endpoint, "lab/weather", WEATHER):
        assert "/lab/weather" not in running.do("topic", "list").out
        shown = running.do("topic", "list", "-v", "--listen", "0.5").out
    assert "/lab/weather [?, foreign]\n" in shown
    assert "/tb3_0/odom [nav_msgs/Odometry, sensor, 25 Hz]\n" in shown


def test_type_and_find(running: Fleet) -> None:
    assert running.do("topic", "type", "/tb3_0/scan").out == "sensor_msgs/LaserScan\n"
    assert running.read("topic", "type", "tb3_0/scan")["types"] == ["sensor_msgs/LaserScan"]
    for spelling in ("geometry_msgs/Twist", "geometry_msgs/msg/Twist"):
        assert running.do("topic", "find", spelling).out == "/tb3_0/cmd_vel\n/tb3_1/cmd_vel\n"
    assert running.do("topic", "find", "-c", "geometry_msgs/Twist").out == "2\n"
    assert running.read("topic", "find", "rosgraph_msgs/Clock") == ["/clock"]
    assert "no topic carries geometry_msgs/Pose now" in running.do("topic", "find", "geometry_msgs/Pose", status=1).err


def test_info(running: Fleet) -> None:
    short = running.do("topic", "info", "/tb3_0/odom").out
    assert short.startswith("Type: nav_msgs/Odometry\n")
    assert "Publisher count: 1\nSubscription count: 1\n" in short
    long = running.read("topic", "info", "-v", "tb3_0/odom")
    [publisher], [subscriber] = long["publishers"], long["subscribers"]
    assert (publisher["node"], publisher["quality"]) == ("/sim", "sensor")
    assert publisher["hz"] == pytest.approx(25)
    assert publisher["sent"] > 0
    assert (subscriber["node"], subscriber["lost"], subscriber["refused"]) == ("/grader", 0, 0)
    assert subscriber["received"] > 0


def test_info_shows_foreigners(running: Fleet) -> None:
    twist = {"linear": {"x": 0.0}}
    with sender(running.endpoint, "tb3_1/cmd_vel", twist, encoding="application/msgpack;geometry_msgs/Twist"):
        told = running.do("topic", "info", "-v", "/tb3_1/cmd_vel").out
    assert "  (foreign)  [geometry_msgs/Twist, -]  " in told
    assert "  /sim  [geometry_msgs/Twist, command]  received " in told


def test_echo_of_a_field(running: Fleet) -> None:
    shown = running.do("topic", "echo", "--once", "--field", "pose.pose.position", "/tb3_1/odom").out
    body, mark = shown.split("---")
    assert mark == "\n"
    assert read_yaml(body)["y"] == pytest.approx(1.0, abs=1e-3)
    # As in rostopic: the field behind the topic's name.
    assert running.do("topic", "echo", "-n", "1", "/tb3_1/odom/header/frame_id").out == "tb3_1/odom\n---\n"
    assert running.lines("topic", "echo", "--once", "tb3_0/joint_states", "--field", "name[0]") == ["wheel_left_joint"]
    many = running.lines(
        "topic", "echo", "--once", "tb3_0/odom", "--field", "child_frame_id", "--field", "header.stamp.sec"
    )
    assert list(many[0]) == ["child_frame_id", "header.stamp.sec"]


def test_echo_counts_and_styles(running: Fleet) -> None:
    shown = running.do("topic", "echo", "-n", "3", "/clock").out
    assert [read_yaml(each)["epoch"] for each in shown.split("---\n")[:-1]] == [0, 0, 0]
    flowing = running.do("topic", "echo", "-n", "2", "/clock", "--flow-style").out.splitlines()
    assert flowing[1::2] == ["---", "---"]
    assert read_yaml(flowing[0]).keys() == {"clock", "tick", "epoch", "paused"}
    ticks = [each["tick"] for each in running.lines("topic", "echo", "-n", "5", "/clock")]
    assert ticks == sorted(set(ticks))
    assert {each % 4 for each in ticks} == {0}


def test_echo_as_csv(running: Fleet) -> None:
    text = running.do(
        "topic", "echo", "--csv", "-n", "2", "tb3_0/imu", "--field", "header.stamp", "--field", "orientation"
    ).out
    head, *rows = csv.reader(io.StringIO(text))
    assert head == ["header.stamp.sec", "header.stamp.nanosec", *(f"orientation.{each}" for each in "xyzw")]
    assert [len(each) for each in rows] == [6, 6]
    assert float(rows[0][5]) == pytest.approx(1.0, abs=1e-6)
    whole = running.do("topic", "echo", "-p", "--no-header", "--once", "tb3_0/scan").out
    assert len(next(csv.reader(io.StringIO(whole)))) == 10 + 360


def test_echo_cuts_lists_and_texts(running: Fleet) -> None:
    assert "ranges: '<array of 360 values>'\n" in running.do("topic", "echo", "--once", "tb3_0/scan", "--no-arr").out
    ranges = ("topic", "echo", "--once", "tb3_0/scan", "--field", "ranges")
    assert len(running.do(*ranges).out.splitlines()) == 128 + 2
    assert len(running.do(*ranges, "-l", "5").out.splitlines()) == 5 + 2
    assert len(running.do(*ranges, "-f").out.splitlines()) == 360 + 1
    assert len(running.lines(*ranges)[0]) == 360
    late = running.do("topic", "echo", "--once", "tb3_0/robot_description", "--no-str").out
    assert late.startswith("data: '<string of ")


def test_echo_with_what_comes_beside_the_message(running: Fleet) -> None:
    first, second = running.lines("topic", "echo", "-n", "2", "tb3_0/odom", "--include-message-info")
    assert second["info"]["sequence"] == first["info"]["sequence"] + 1 + second["info"]["lost_before"]
    assert first["info"]["type"] == "nav_msgs/Odometry"
    assert not first["info"]["foreign"]
    assert first["message"]["child_frame_id"] == "tb3_0/base_footprint"


def test_echo_of_unknown_types_and_foreign_senders(running: Fleet) -> None:
    with sender(running.endpoint, "lab/weather", WEATHER, encoding="application/msgpack;lab_msgs/Weather"):
        ended = running.do("topic", "echo", "--once", "lab/weather")
        assert read_yaml(ended.out.removesuffix("---\n")) == {
            "temperature": 20.5,
            "wind": [1, 2],
            "grid": [[0, 1], [2, 3]],
        }
        assert "the type lab_msgs/Weather is not known here" in ended.err
        assert "a foreign sender" in ended.err
        assert (
            "unknown field 'hail'"
            in running.do("topic", "echo", "--once", "lab/weather", "--field", "hail", status=2).err
        )
    with sender(running.endpoint, "lab/speed", {"linear": {"x": 1}}):
        [typed] = running.lines("topic", "echo", "--once", "lab/speed", "geometry_msgs/msg/Twist")
        assert typed["angular"] == {"x": 0, "y": 0, "z": 0}
    with sender(running.endpoint, "tb3_1/cmd_vel", {"linear": {"x": "fast"}}):
        ended = running.do("topic", "echo", "--once", "tb3_1/cmd_vel")
        assert read_yaml(ended.out.removesuffix("---\n")) == {"linear": {"x": "fast"}}
        assert "no geometry_msgs/Twist, readers refuse it" in ended.err
    with sender(running.endpoint, "lab/noise", b"\xc1\xc1"):
        ended = running.do("topic", "echo", "--once", "lab/noise", "--timeout", "1.5", status=1)
        assert "2 bytes that are not MessagePack" in ended.err


def test_hz_counts_what_was_lost(running: Fleet) -> None:
    """Each fourth number is missing: 3 of 4 arrive, and the rate is that of all 4."""
    with sender(running.endpoint, "lab/numbers", {"a": 1}, numbers=True):
        *_, last = running.lines("topic", "hz", "lab/numbers", "-n", "30")
    assert last["received"] == 30
    assert 9 <= last["lost"] < 20
    assert last["wall"]["count"] == 29 + last["lost"]
    assert last["wall"]["hz"] == pytest.approx((29 + last["lost"]) / last["wall"]["span"])


def test_hz_over_a_window_and_of_several_topics(running: Fleet) -> None:
    shown = running.do("topic", "hz", "tb3_0/odom", "/clock", "-n", "20", "-w", "10").out
    assert "/tb3_0/odom\naverage rate: 25.000 by simulation time, promised 25\n\tmin: 0.040s max: 0.040s" in shown
    assert "/clock\naverage rate: 50.000 by simulation time, promised 50\n" in shown
    assert "\twindow: 10 received: 20 lost: " in shown


def test_bw(running: Fleet) -> None:
    *_, last = running.lines("topic", "bw", "tb3_0/scan", "-n", "4", "--window", "3")
    size = last["size"]["mean"]
    assert 1440 < last["size"]["min"] <= size <= last["size"]["max"] < 2500
    assert last["bytes_per_simulated_s"] == pytest.approx(5 * size)
    assert (last["received"], last["window"]) == (4, 3)
    assert (
        "KB/s by simulation time, from 2 messages\n\tMessage size mean: 1."
        in running.do("topic", "bw", "tb3_0/scan", "-n", "2").out
    )


def test_delay(running: Fleet) -> None:
    *_, last = running.lines("topic", "delay", "tb3_0/odom", "-n", "10")
    assert 0 <= last["since_sent"]["min"] <= last["since_sent"]["mean"] <= last["since_sent"]["max"] < 5
    assert 0 <= last["since_stamp"]["mean"] < 5
    assert "average delay since it was sent" in running.do("topic", "delay", "tb3_0/odom", "-n", "2").out
    with sender(running.endpoint, "lab/weather", WEATHER):
        shown = running.do("topic", "delay", "lab/weather", "-n", "2").out
    assert "no delay since its stamp, by simulation time: the messages have no stamp" in shown


@pytest.mark.parametrize("verb", ["echo", "hz", "bw", "delay"])
def test_ctrl_c_ends_it_with_a_last_word(running: Fleet, verb: str) -> None:
    with running.started("topic", verb, "/tb3_0/odom") as process:
        assert process.stdout is not None
        process.stdout.readline()
        ended = interrupt(process)
    assert ended.status == 0
    assert [line for line in ended.err.splitlines() if "lost" not in line] == []
    last = {"echo": "---", "hz": "lost: ", "bw": "lost: ", "delay": "window:"}[verb]
    assert last in ended.out.splitlines()[-1]


def test_interrupted_before_what_was_asked(running: Fleet) -> None:
    with running.started("topic", "hz", "/tb3_0/odom", "-n", "100000") as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert interrupt(process).status == 130


@pytest.mark.parametrize("topic", ["/tb3_0/odom", "/tb3_0/robot_description"])
def test_a_closed_pipe_ends_it_quietly(running: Fleet, topic: str) -> None:
    """The second topic tells nothing more after its first message."""
    line = f"{sys.executable} -P -m deploy topic echo --flow-style {topic} | head -n 1"
    began = time.monotonic()
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        env=running.terminal.environment,
        cwd=running.terminal.folder,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr, done.stdout.count("\n")) == (0, "", 1)
    assert time.monotonic() - began < 20


def test_a_full_disk_is_told(running: Fleet) -> None:
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -P -m deploy topic echo /tb3_0/odom > /dev/full"],
        env=running.terminal.environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (1, "elea: the output cannot be written: No space left on device\n")


def test_waiting_for_a_topic(running: Fleet) -> None:
    with running.started("topic", "echo", "--wait", "--once", "/lab/later", "--timeout", "30", "--json") as waiting:
        until(lambda: "/_echo_" in running.do("node", "list", "-a").out, 20.0, "the echo in the graph")
        with sender(running.endpoint, "lab/later", {"a": 1}):
            out, err = waiting.communicate(timeout=30)
    assert json.loads(out) == {"a": 1}
    assert "nobody publishes /lab/later yet: waiting" in err
    silent = running.do("topic", "hz", "/tb3_0/cmd_vel", "--timeout", "1", status=1)
    assert "nothing came on /tb3_0/cmd_vel within 1 s" in silent.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["echo", "/tb3_0/odm"], "no topic /tb3_0/odm is on the network; did you mean '/tb3_0/odom'?"),
        (["hz", "/tb3_0/odm"], "no topic /tb3_0/odm is on the network; did you mean '/tb3_0/odom'?"),
        (["type", "/tb3_0/odm"], "did you mean '/tb3_0/odom'?"),
        (["info", "/tb3_0/odm"], "did you mean '/tb3_0/odom'?"),
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
        (["ecoh", "/tb3_0/odom"], "unknown verb 'ecoh'; did you mean 'echo'"),
        (["list", "--port", "1"], "no fleet runs on port 1"),
        (["list", "--connect", "tcp/127.0.0.1:1"], "no router at tcp/127.0.0.1:1"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input(running: Fleet, arguments: list[str], said: str) -> None:
    ended = running.do("topic", *arguments, status=2)
    assert said in ended.err
    assert ended.out == ""
