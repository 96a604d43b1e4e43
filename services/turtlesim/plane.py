"""The plane with its turtles: their names, pens and poses, and the drawing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from messages.names import BadName, validate
from messages.turtlesim import Color
from services.runtime.errors import BadInput, unknown_name
from services.turtlesim.drawing import Canvas, Trails
from services.turtlesim.turtle import PLANE_M, Turtle

MOST_TURTLES = 200
LONGEST_NAME = 64
PEN_COLOUR = Color(r=179, g=184, b=255)


@dataclass(frozen=True)
class Pen:
    """The pen of a turtle; ``width`` in pixels of ROS's window."""

    colour: Color = PEN_COLOUR
    width: int = 3
    down: bool = True


@dataclass
class TurtleState:
    """A turtle on the plane, its pen, and the last colour of its sensor."""

    turtle: Turtle
    sensed_colour: Color
    pen: Pen = Pen()


class Plane:
    """The turtles by name; turtle1 exists from the start. ``generation`` increases whenever the drawing is cleared."""

    def __init__(self, background: Color) -> None:
        self.turtles: dict[str, TurtleState] = {}
        self.trails = Trails()
        self.background, self.generation = background, 0
        self._canvas, self._count = Canvas(background), 0
        self.reset(background)

    def reset(self, background: Color) -> None:
        """Restart with an empty plane and turtle1 in its middle, facing along x."""
        self.turtles, self._count = {}, 0
        self.clear(background)
        self.spawn("", PLANE_M / 2, PLANE_M / 2, 0.0)

    def clear(self, background: Color) -> None:
        """Clear the drawing, and paint the background."""
        self.background, self.generation = background, self.generation + 1
        self._canvas.clear(background)
        self.trails.clear()

    def spawn(self, name: str, x: float, y: float, theta: float) -> str:
        """Add a turtle at a pose [m, m, rad]; return its name, by default the next free one. Raises BadInput."""
        counted = False
        if len(self.turtles) >= MOST_TURTLES:
            raise BadInput(f"there are already {MOST_TURTLES} turtles, the maximum: kill some first")
        while not name or (counted and name in self.turtles):
            counted, self._count = True, self._count + 1
            name = f"turtle{self._count}"
        try:
            validate(name, LONGEST_NAME)
        except BadName as error:
            raise BadInput(f"no turtle can have this name: {error}") from None
        if name.startswith(("/", "~")):
            raise BadInput(
                f"no turtle can have the name {name!r}: its topics are named below it, so it must not begin with '/' "
                "or '~'"
            )
        if name in self.turtles:
            raise BadInput(f"there is already a turtle {name!r}: give another name, or none")
        turtle = Turtle(0.0, 0.0, 0.0).placed(x, y, theta)
        self.turtles[name] = TurtleState(turtle, self._canvas.colour_at((turtle.x, turtle.y)))
        return name

    def kill(self, name: str) -> None:
        """Remove a turtle; its trail stays. Raises BadInput."""
        if name not in self.turtles:
            raise unknown_name("turtle", name, self.turtles)
        del self.turtles[name]
        self.trails.lift(name)

    def move(self, name: str, motion: Callable[[Turtle], Turtle]) -> Turtle:
        """Move a turtle, which draws if its pen is down."""
        state = self.turtles[name]
        before, after = state.turtle, motion(state.turtle)
        start, end, pen = (before.x, before.y), (after.x, after.y), state.pen
        state.turtle = after
        state.sensed_colour = self._canvas.colour_at(end)
        if not pen.down:
            self.trails.lift(name)
        elif start != end:
            self._canvas.draw(start, end, pen.colour, pen.width)
            self.trails.draw(name, start, end, pen.colour, pen.width)
        return after
