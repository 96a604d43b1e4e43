"""What services are told about the fleet that they run in, each in its own parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from deploy.fleet import Fleet, Robot
from models.figures import read_model
from services.panel.address import FILE as PANEL_FILE
from services.runtime.parameters import build
from services.sim import BaseParameters
from services.sim.settings import configured

IMPLIED = ("router", "sim", "grader")
"""Services that every fleet has; a fleet file states one only to set its parameters."""


class Terms(msgspec.Struct, frozen=True, kw_only=True):
    """What the command line adds to a fleet file: where results go, the network, whether to open a viewer."""

    folder: Path
    domain: str = ""
    links: tuple[str, ...] = ()
    view: bool = True


def endpoint(fleet: Fleet) -> str:
    """Where the fleet's router listens."""
    return f"tcp/127.0.0.1:{fleet.run.port}"


def wired(kind: str, fleet: Fleet, terms: Terms, members: tuple[str, ...]) -> dict[str, Any]:
    """The parameters that a service gets from the fleet; its own table in the fleet file wins over them."""
    run, robots = fleet.run, fleet.robot
    match kind:
        case "router":
            return {"listen": endpoint(fleet), "link": list(terms.links)}
        case "sim":
            return {
                "robots": [_entry(each) for each in robots],
                "mode": run.mode,
                "factor": run.factor,
                "latency": run.latency,
                "seed": run.seed,
                "members": list(members),
            }
        case "grader":
            return {
                "robots": [each.name for each in robots],
                "halting": [_halting(each) for each in robots if read_model(each.model).wheels],
                "ends": run.ends,
                "duration": run.duration,
                "output": str(terms.folder),
            }
        case "logger":
            viewer = {} if terms.view else {"view": "never"}
            return {
                "robots": [each.name for each in robots],
                "models": [each.model for each in robots] or ["burger"],
                "file": str(terms.folder / "run.rrd"),
                **viewer,
            }
        case "panel":
            return {"address": str(terms.folder / PANEL_FILE)}
        case _:
            return {}


def _entry(robot: Robot) -> dict[str, Any]:
    pose = {"x": robot.pose.x, "y": robot.pose.y, "yaw": robot.pose.yaw}
    return {"name": robot.name, "model": robot.model, **pose, "parameters": robot.parameters}


def _halting(robot: Robot) -> dict[str, Any]:
    """How the base of a robot stops when its commander falls silent: by its parameters, else by its model."""
    base = configured(robot.model, build(BaseParameters, robot.parameters)).parameters
    return {"name": robot.name, "timeout": base.cmd_vel_timeout, "brake": base.brake}
