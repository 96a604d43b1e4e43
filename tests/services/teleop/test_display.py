"""The display of teleop."""

from __future__ import annotations

from dataclasses import replace

import pytest

from messages.elea import BaseStatus
from messages.geometry import Twist
from services.teleop.keys import MOVES, SCALES, ZERO_VELOCITY, Velocity
from services.teleop.screen import View, header_text, render_lines

NODE = "/p3dx/teleop"
VIEW = View(
    node=NODE,
    speed=0.5,
    turn=1.0,
    at_limit=False,
    sent=Velocity(0.5, 0, 0, -1.0),
    odometry_twist=Twist.planar(0.218, -0.0001),
    base_status=BaseStatus(source=NODE),
)


def test_the_keys_are_all_named() -> None:
    shown = header_text("/p3dx/cmd_vel")
    assert "driving /p3dx/cmd_vel" in shown
    words = shown.replace("/", " ").split()
    assert [key for key in (*MOVES, *SCALES) if key not in words] == []


def test_a_robot_under_way() -> None:
    assert render_lines(VIEW) == (
        "   set     speed 0.50 m/s   turn 1.00 rad/s",
        "   sends   +0.50 m/s ahead   -1.00 rad/s",
        "   robot   +0.22 m/s   +0.00 rad/s",
        "   base    obeys these keys",
    )


@pytest.mark.parametrize(
    ("sent", "text"),
    [
        (None, "nothing: others may drive"),
        (ZERO_VELOCITY, "stop"),
        (Velocity(yaw=1.0), "+1.00 rad/s"),
        (Velocity(-0.5, 0.5), "-0.50 m/s ahead   +0.50 m/s left"),
        (Velocity(z=0.5), "+0.50 m/s up"),
    ],
)
def test_what_is_sent(sent: Velocity | None, text: str) -> None:
    assert render_lines(replace(VIEW, sent=sent))[1] == f"   sends   {text}"


@pytest.mark.parametrize(
    ("base", "text"),
    [
        (None, "no status: is the robot still in the simulation?"),
        (BaseStatus(source=NODE, e_stopped=True), "EMERGENCY STOP, until false is sent on e_stop"),
        (BaseStatus(source="/p3dx/square"), "obeys /p3dx/square"),
        (BaseStatus(), "no commands"),
        (BaseStatus(source=NODE, colliding=True), "obeys these keys, touches something"),
    ],
)
def test_the_base(base: BaseStatus | None, text: str) -> None:
    assert render_lines(replace(VIEW, base_status=base))[3] == f"   base    {text}"


def test_trouble_stands_before_the_base() -> None:
    assert render_lines(replace(VIEW, error="the simulation is paused"))[3] == "   base    the simulation is paused"


def test_the_limit_and_missing_odometry() -> None:
    shown = render_lines(replace(VIEW, at_limit=True, odometry_twist=None))
    assert shown[0].endswith("(the limit)")
    assert shown[2] == "   robot   no odometry"
