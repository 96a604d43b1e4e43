"""ROS 1 programs that need no robot: their output is the same as under ROS Noetic's own rospy."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest

from tests.harness.cases import case
from tests.ros1.script_fleets import (
    Jobs,
    Lines,
    Runs,
    assert_began,
    assert_said,
    assert_same,
    lockstep_runs,
    run_until_said,
    side_by_side,
)

REFUSED = "service [/services/{}] responded with an error: b'{}'"
SAID = {
    "talk": {
        "busy": ["first: reading", "went round True", "waited"],
        "doubler": ["more than ten: 12", "more than ten: 14"],
        "graph_tool": [
            "chatter is std_msgs/String",
            "nodes [True, True, False]",
            "std_msgs/String /chatter",
            "online True",
            "not found: no_such_package",
        ],
        "listener": ["steps [1, 1, 1, 1] from /chatter"],
        "number_sink": ["reached 12"],
        "two_inputs": ["mixed 20"],
        "user_data": ["each callback got 4 and both saw the same: True"],
        "fibonacci": ["/fibonacci: order 6", "/fibonacci: Preempted", "/fibonacci: Preempted", "/fibonacci: order 3"],
        "fibonacci_client": [
            "in time: True",
            "state 3, result [0, 1, 1, 2, 3, 5, 8]",
            "['active', 'done 3 [0, 1, 1, 2, 3, 5]'] True",
            "in time: False",
            "begins with 3",
            "cancelled: True",
            "status 3",
        ],
        "mission": ["done at level 120 with [0, 1, 2, 3, 4]"],
        "services_client": [
            "on off on",
            "True from a dict",
            "from a list",
            "failing: " + REFUSED.format("failing", "error processing request: no such luck"),
            "nothing: " + REFUSED.format("nothing", "service cannot process request: service handler returned None"),
            "missing: service [/services/missing] unavailable",
            "wait: timeout exceeded while waiting for service /services/missing",
        ],
        "timers": ["once, with last_real None", "ticks at the end: 5"],
        "workers": ["total 15, sent 15, sum 1530"],
        "frames_listener": [
            "lamp at [1.0, 0.0, 0.5], yaw 1.5708",
            "fly at distance 1.000",
            "point 1.00 1.00 0.50",
            "unknown: True",
            "not yet",
            "frames [False, True, False]",
        ],
        "frames_tf2": [
            "desk in shelf: 2.00 0.00",
            "pose 2.00 -1.00 in shelf",
            "InvalidArgumentException",
            "cart at 0.9",
        ],
        "synchronized": ["equal pairs True", "cache holds True"],
        "bad_callback": ["RuntimeError: odd 1", "good [0, 2, 4]", "refused: field data must be an integer type"],
    },
    "nodes": {
        "command_line": ["4 times red on /paints, remapped True", "stopping 'command_line' at 4"],
        "header_listener": ["seq rises by [1, 1, 1, 1, 1]", "mean gap 0.2 s in desk"],
        "lab/desk/names": [
            "name /lab/desk/names namespace /lab/desk/",
            "/lab/desk/a /a /lab/desk/names/a",
            "remapped /lab/desk/after",
            "/lab/desk/inner/deep/number /lab/desk/names/number /lab/desk/after",
            "7",
            "private 0.5 [1, True] 'red'",
            "args ['plain']",
        ],
        "durations": [
            "13 750000000 2.50",
            "True True -0.75",
            "rospy.Time[1000000005] 12500000000",
            "times do not add",
            "a second: True",
            "late: True",
            "half: True",
        ],
        "parameter_reader": [
            "lamps 7",
            "kitchen {'lamps': 2} heights [2.5, 3.0]",
            "private 0.5 [1, 2] True",
            "of another node 0.25",
            "default fallback",
            "has True False",
            "found /gain",
            "left ['kitchen']",
            "KeyError '/house/cellar'",
            "nothing to delete",
            "mine ['/house/heights', '/house/ready', '/house/rooms/kitchen/lamps']",
        ],
        "python2": ["hall: 2", "caught old style", "0 1 2 ", "2 rooms 1", "493 10 [1, 2]"],
        "sum_client": ["3 + 4 = (7, 7, 7)"],
        "sum_server": ["Ready to add.", "Returning [3 + 4 = 7]"],
        "cloud": ["8 points of 16 bytes, far (3.0, 1.0, 0.5)", "plain 2"],
        "map_reader": ["map 20x10, 20 walls, 180 unknown, tuple"],
        "markers": ["5 points, type 4, last 16.0", "[0, 1, 2]"],
        "red_finder": ["32x24 bgr8, grown by [1, 1, 1]"],
        "rotations": [
            "euler [0.1, -0.2, 1.3]",
            "w 0.788097 of a ndarray",
            "matrix [1.0, 2.0, 3.0]",
            "identity True",
            "half way 0.5000",
            "sum 0.7500",
            "back -0.7500",
            "rotation [[0, -1], [1, 0]]",
            "from matrix True",
            "zero True",
            "axis 0.3000",
            "euler by matrix [0.2, 0.3, 0.4]",
        ],
        "array_listener": ["ndarray of float32, mean 2.650", "tuple 4", "rows 2.0"],
        "bag_round": [
            "sum 45",
            "words 105.5 hello",
            "cmd_vel 107.25 0.25",
            "window [2, 3, 4]",
            "12 messages, types ['geometry_msgs/Twist', 'std_msgs/Int32', 'std_msgs/String']",
        ],
        "greeted": ["words ['welcome']"],
        "headers": ["std_msgs/String by /headers, latching 1", "colour green", "asked by /headers", "peers 1 32"],
        "hooks": ["first hook, down: False", "second hook", "down: True"],
        "joints": ["header: ", "  - elbow", "position: [0.23924932921398198, 0.5]", "velocity: []"],
        "last_words": ["good bye", "timeout exceeded while waiting for message on topic silence"],
        "logs": ["2 info 1", "4 warn", "8 error", "16 fatal", "2 once", "4 throttled"],
        "own_signals": ["mine: True", "beats 8"],
        "subscribe_notify": ["a peer subscribed to /greetings", "a peer left, 0 remain"],
    },
}
"""Expected output of each fleet's programs."""
SAID_IN_LOCKSTEP = {"talk": {"fibonacci_client": ["feedback [3, 4, 5, 6]"], "mission": ["beats True"]}}
"""What depends on the order of two topics or threads, which only lockstep keeps.

As in ROS, an action client drops feedback that it reads after the result.
"""
LOCKSTEP_S = 4
"""Simulation time [s] within which all is printed if no program is late."""
MEASURING = ("busy", "doubler", "durations", "header_listener", "number_sink")
"""Programs that print how precisely they waited, or what came while they did: on a busy machine, only their first words
hold in real time. One that stood still gets several messages at once, and one that is linked late misses the first.
"""
REPEATED = {"talk"}
"""Fleets whose output depends on the order of messages, calls and threads, and could depend on timing."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runs]:
    folder = tmp_path_factory.mktemp("talk")
    real: Jobs = {
        f"{fleet} real": partial(run_until_said, fleet, folder / f"{fleet}0", exact(fleet), begun=measured(fleet))
        for fleet in SAID
    }
    with side_by_side(real | lockstep_runs(folder, dict.fromkeys(SAID, LOCKSTEP_S), REPEATED)) as runs:
        yield runs


@pytest.mark.timeout(420)
def test_programs_say_in_real_time_what_they_say_under_ros(runs: Runs) -> None:
    for fleet in SAID:
        with case(fleet):
            run = runs[f"{fleet} real"].result()
            assert_said(run, exact(fleet))
            assert_began(run, measured(fleet))


def exact(fleet: str) -> Lines:
    """Return the lines of a fleet's programs that are the same on any machine."""
    return {program: said for program, said in SAID[fleet].items() if program not in MEASURING}


def measured(fleet: str) -> Lines:
    """Return the lines of those that measure time."""
    return {program: said for program, said in SAID[fleet].items() if program in MEASURING}


@pytest.mark.timeout(420)
def test_in_lockstep_they_say_it_too_and_the_same_twice(runs: Runs) -> None:
    for fleet, said in SAID.items():
        with case(fleet):
            first = runs[f"{fleet} 1"].result()
            assert_said(first, said)
            assert_said(first, SAID_IN_LOCKSTEP.get(fleet, {}))
            if fleet in REPEATED:
                assert_same(first, runs[f"{fleet} 2"].result(), [*said])
