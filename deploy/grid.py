"""``[[grid]]`` of a fleet file: any number of identical robots in a grid, and their goals."""

from __future__ import annotations

import math
from collections.abc import Callable
from random import Random

from msgspec.structs import replace

from deploy.fleet import Fleet, GoalRule, GridConfig, RobotConfig
from models.toml_source import TomlKey

Place = tuple[float, float]


def expand_grids(fleet: Fleet) -> Fleet:
    """Return the fleet with the robots of its grids after its own, and without grids."""
    robots = tuple(robot for grid in fleet.grid for robot in grid_robots(grid))
    return replace(fleet, robot=(*fleet.robot, *robots), grid=())


def grid_robots(grid: GridConfig) -> tuple[RobotConfig, ...]:
    """Return the robots of a grid, row by row from the one with the least x and y, along x first."""
    places = grid_places(grid.robots, grid.columns or math.ceil(math.sqrt(grid.robots)), grid.spacing)
    goals = grid_goals(places, grid.goals, grid.seed)
    centre = grid.pose
    return tuple(
        RobotConfig(
            name=f"{grid.name}_{number}",
            model=grid.model,
            xacro_args=grid.xacro_args,
            pose=replace(centre, x=centre.x + place[0], y=centre.y + place[1]),
            goals=((centre.x + goal[0], centre.y + goal[1]),) if goal is not None else (),
            parameters=grid.parameters,
            services=grid.services,
        )
        for number, (place, goal) in enumerate(zip(places, goals, strict=True))
    )


def grid_places(count: int, columns: int, spacing: float) -> list[Place]:
    """Return places [m] relative to the grid's centre; the last row may be shorter."""
    width, height = (min(count, columns) - 1) * spacing, (math.ceil(count / columns) - 1) * spacing
    return [(spacing * (k % columns) - width / 2, spacing * (k // columns) - height / 2) for k in range(count)]


def grid_goals(places: list[Place], rule: GoalRule, seed: int) -> list[Place] | list[None]:
    """Return the goal of each place; no two robots share one."""
    match rule:
        case "none":
            return [None] * len(places)
        case "mirror":
            return [(-x, y) for x, y in places]
        case "rotate":
            return [(-x, -y) for x, y in places]
        case "shuffle":
            return [places[k] for k in _one_cycle(len(places), Random(seed))]


def _one_cycle(count: int, random: Random) -> list[int]:
    """Return a random permutation that leaves nothing in its place (Sattolo's algorithm)."""
    order = list(range(count))
    for last in range(count - 1, 0, -1):
        other = int(random.random() * last)
        order[last], order[other] = order[other], order[last]
    return order


def grid_key(fleet: Fleet) -> Callable[[tuple[TomlKey, ...]], tuple[TomlKey, ...]]:
    """Return a function from a key of the expanded fleet to its key as written: that of a grid's robot in its grid.

    Args:
        fleet: The fleet as written, with its grids.
    """
    owners = [number for number, grid in enumerate(fleet.grid) for _ in range(grid.robots)]
    stated = len(fleet.robot)

    def written(path: tuple[TomlKey, ...]) -> tuple[TomlKey, ...]:
        match path:
            case ("robot", int(index), *rest) if index >= stated and index - stated < len(owners):
                return ("grid", owners[index - stated], *rest)
        return path

    return written
