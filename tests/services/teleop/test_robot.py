"""Discovery of bases, and the choice of one by name."""

from __future__ import annotations

import pytest

from messages.geometry import Twist, TwistStamped
from messages.nav import Odometry
from services.runtime.errors import BadInput
from services.runtime.graph import Entity
from services.teleop.robot import BaseInfo, choose_base, find_bases

TWIST = Twist.ROS_TYPE


def entity(kind: str, node: str, name: str, record: str = TWIST) -> Entity:
    return Entity("ab", kind, node, name, record, "COMMAND")  # type: ignore[arg-type]


GRAPH = [
    entity("node", "/sim", "sim", "-"),
    entity("sub", "/sim", "/p3dx/cmd_vel"),
    entity("pub", "/sim", "/p3dx/odom", Odometry.ROS_TYPE),
    entity("sub", "/sim", "/tb3_0/cmd_vel", TwistStamped.ROS_TYPE),
    entity("pub", "/sim", "/tb3_0/odom", Odometry.ROS_TYPE),
    entity("sub", "/logger", "/ghost/cmd_vel"),
    entity("pub", "/logger", "/rosout"),
    entity("pub", "/p3dx/teleop", "/p3dx/cmd_vel"),
]
FOUND = find_bases(GRAPH)


def test_a_base_is_who_takes_commands_and_tells_of_itself() -> None:
    assert {
        "/p3dx": BaseInfo("/p3dx", "/p3dx/cmd_vel", TWIST),
        "/tb3_0": BaseInfo("/tb3_0", "/tb3_0/cmd_vel", TwistStamped.ROS_TYPE),
    } == FOUND


def test_a_base_may_lie_in_the_root() -> None:
    root = find_bases([entity("sub", "/b", "/cmd_vel"), entity("pub", "/b", "/odom")])
    assert root == {"/": BaseInfo("/", "/cmd_vel", TWIST)}
    assert choose_base("/", root, "x").topic == "/cmd_vel"


@pytest.mark.parametrize("base", ["/p3dx", ""])
def test_the_name_of_a_controller_leads_to_its_base(base: str) -> None:
    topics = [f"{base}{each}" for each in ("/cmd_vel", "/diff/cmd_vel")]
    told = [entity("pub", "/sim", f"{base}{each}") for each in ("/odom", "/diff/odom", "/base_status")]
    found = find_bases([*told, *(entity("sub", "/sim", each) for each in topics)])
    for asked in ("", base or "/", f"{base}/diff"):
        assert choose_base(asked, found, "x") == BaseInfo(base or "/", f"{base}/cmd_vel", TWIST), asked
    with pytest.raises(BadInput, match="known: "):
        choose_base(f"{base}/other", found, "x")


@pytest.mark.parametrize("asked", ["/p3dx", "p3dx", "/p3dx/"])
def test_a_base_is_found_by_its_namespace(asked: str) -> None:
    assert choose_base(asked, FOUND, "tcp/x:1").topic == "/p3dx/cmd_vel"


def test_the_only_base_needs_no_name() -> None:
    assert choose_base("", {"/p3dx": FOUND["/p3dx"]}, "tcp/x:1").namespace == "/p3dx"


@pytest.mark.parametrize(
    ("asked", "found", "message"),
    [
        ("/p3dy", FOUND, r"no robot takes commands on /p3dy/cmd_vel; did you mean '/p3dx'\? \(known: /p3dx, /tb3_0\)"),
        ("", FOUND, "there are several robots: choose one of /p3dx, /tb3_0"),
        ("", {}, "no robot takes commands at tcp/x:1: is a fleet with a robot running"),
        ("/p3dx", {}, "no robot takes commands at tcp/x:1: is a fleet with a robot running"),
        ("p3 dx", FOUND, "'p3 dx' is not a name"),
    ],
)
def test_a_base_that_is_not_there_is_told_with_those_that_are(
    asked: str, found: dict[str, BaseInfo], message: str
) -> None:
    with pytest.raises(BadInput, match=message):
        choose_base(asked, found, "tcp/x:1")
