"""The turtles without a network: motion, walls, names, pens and trails."""

from __future__ import annotations

import itertools
import math

import pytest

from messages.std import SECOND
from messages.turtlesim import Color
from services.runtime.errors import BadInput
from services.turtlesim.drawing import MAX_POINTS, TOLERANCE_M, Trails
from services.turtlesim.plane import Pen, Plane
from services.turtlesim.turtle import PLANE_M, Turtle, Velocity

BLUE, RED = Color(r=69, g=86, b=255), Color(r=255)
STEP_NS, STEP_S = 20_000_000, 0.02


def drive(turtle: Turtle, velocity: Velocity, seconds: float, since: int = 0) -> tuple[Turtle, int]:
    now = since
    turtle = turtle.command(velocity, now)
    for _ in range(round(seconds / STEP_S)):
        now += STEP_NS
        turtle = turtle.step(now, STEP_S)
    return turtle, now


def test_it_turns_first_and_then_moves_and_rests_a_second_after_its_last_command() -> None:
    start = Turtle(5.0, 5.0, 0.0)
    once = start.command(Velocity(ahead=1.0, turn=math.pi / 2), 0).step(STEP_NS, STEP_S)
    turned = math.pi / 2 * STEP_S
    assert (once.x, once.y, once.theta) == pytest.approx(
        (5.0 + STEP_S * math.cos(turned), 5.0 + STEP_S * math.sin(turned), turned)
    )
    rested, _ = drive(start, Velocity(ahead=2.0), 3.0)
    assert rested.x == pytest.approx(7.0), "it obeys for one second"
    assert rested.pose().linear_velocity == 0.0
    turned_round, _ = drive(start, Velocity(turn=4.0), 1.0)
    assert turned_round.theta == pytest.approx(4.0 - math.tau), "headings are in [-pi, pi]"
    sideways, _ = drive(start, Velocity(left=1.0), 1.0)
    assert (sideways.x, sideways.y) == pytest.approx((5.0, 6.0))
    assert Turtle(PLANE_M / 2, PLANE_M / 2, 0.0).pose().x == 5.544444561004639, "as ROS's float32"


def test_walls_hold_it_and_it_can_be_put_elsewhere() -> None:
    held, _ = drive(Turtle(10.5, 5.0, 0.0), Velocity(ahead=2.0), 1.0)
    assert (held.x, held.at_wall) == (PLANE_M, True)
    along, _ = drive(held.placed(held.x, 5.0, math.pi / 4), Velocity(ahead=1.0), 1.0)
    assert along.y == pytest.approx(5.0 + math.sqrt(0.5)), "it slides along the wall"
    assert along.placed(-3.0, 20.0, 7.0).held_on_plane().x == 0.0
    moved = Turtle(1.0, 1.0, 0.0).displaced(2.0, math.pi / 2)
    assert (moved.x, moved.y, moved.theta) == pytest.approx((1.0, 3.0, math.pi / 2))


def test_names_are_counted_as_in_ros_and_wrong_ones_refused() -> None:
    plane = Plane(BLUE)
    assert list(plane.turtles) == ["turtle1"]
    assert plane.spawn("", 1.0, 1.0, 0.0) == "turtle2"
    assert plane.spawn("turtle3", 1.0, 1.0, 0.0) == "turtle3"
    plane.kill("turtle2")
    assert plane.spawn("", 1.0, 1.0, 0.0) == "turtle4", "a number is not given twice"
    for name, why in (
        ("turtle1", "there is already a turtle 'turtle1': give another name, or none"),
        ("two words", "no turtle can have this name: 'two words'"),
        ("/turtle9", "so it must not begin with '/' or '~'"),
        ("a" * 65, "64"),
    ):
        with pytest.raises(BadInput, match=why):
            plane.spawn(name, 1.0, 1.0, 0.0)
    with pytest.raises(BadInput, match=r"unknown turtle 'turtel1'; did you mean 'turtle1'\?"):
        plane.kill("turtel1")
    plane.reset(RED)
    assert list(plane.turtles) == ["turtle1"]
    assert plane.spawn("", 1.0, 1.0, 0.0) == "turtle2"


def test_the_pen_draws_what_the_colour_sensor_sees() -> None:
    plane = Plane(BLUE)
    me = plane.turtles["turtle1"]
    assert me.sensed_colour == BLUE
    me.pen = Pen(RED, 5)
    plane.move("turtle1", lambda turtle: turtle.displaced(2.0, 0.0))
    plane.move("turtle1", lambda turtle: turtle.displaced(-1.0, 0.0))
    assert me.sensed_colour == RED
    me.pen = Pen(RED, 5, down=False)
    plane.move("turtle1", lambda turtle: turtle.displaced(0.0, math.pi / 2))
    plane.move("turtle1", lambda turtle: turtle.displaced(0.04, 0.0))
    assert me.sensed_colour == RED, "within the pen's width"
    plane.move("turtle1", lambda turtle: turtle.displaced(1.0, 0.0))
    assert me.sensed_colour == BLUE
    assert [(line.colour, line.width, len(line.points)) for line in plane.trails.lines.values()] == [(RED, 5, 3)]
    plane.clear(RED)
    plane.move("turtle1", lambda turtle: turtle.step(SECOND, STEP_S))
    assert me.sensed_colour == RED
    assert not plane.trails.lines


def test_a_trail_is_as_fine_as_it_must_be() -> None:
    trails, here = Trails(), (0.0, 0.0)
    ways = [(n * 0.02, 0.0) for n in range(1, 200)]
    ways += [(3.98 + math.sin(n * 0.02), 1.0 - math.cos(n * 0.02)) for n in range(1, 6000)]
    for there in ways:
        trails.draw("turtle1", here, there, RED, 3)
        here = there
    lines = list(trails.lines.values())
    assert len(lines[0].points) == MAX_POINTS
    count = sum(len(line.points) for line in lines)
    assert 500 < count < 1500
    assert [line.points[0] for line in lines[1:]] == [line.points[-1] for line in lines[:-1]], "without a gap"
    corners = [point for line in lines for point in line.points]
    for x, y in ways[:400]:
        assert min(off_segment((x, y), a, b) for a, b in itertools.pairwise(corners)) < TOLERANCE_M * 1.01


def test_a_dropped_line_is_not_drawn_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.turtlesim.drawing.MAX_LINES", 2)
    trails = Trails()
    for turtle in "abc":
        trails.draw(turtle, (0.0, 0.0), (1.0, 0.0), RED, 3)
    trails.draw("a", (1.0, 0.0), (2.0, 0.0), RED, 3)  # its first line was the oldest
    assert [line.turtle for line in trails.lines.values()] == ["c", "a"]


def off_segment(point: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> float:
    (px, py), (ax, ay), (bx, by) = point, a, b
    square = (bx - ax) ** 2 + (by - ay) ** 2
    share = max(0.0, min(1.0, ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / square)) if square else 0.0
    return math.hypot(px - ax - share * (bx - ax), py - ay - share * (by - ay))
