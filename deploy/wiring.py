"""What services are told about the fleet that they run in, each in its own parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from deploy.arm_wiring import graded_arms, not_before, states
from deploy.fleet import Fleet, Robot
from deploy.run_folder import BAG_FOLDER, RECORDING_FILE, STOPS_FILE
from models.figures import read_model
from services.logger import LoggerParameters
from services.panel.address import FILE as PANEL_FILE
from services.runtime.network.sockets import router_endpoint
from services.runtime.network.zenoh_config import PORT
from services.runtime.parameters.record import build
from services.runtime.service import Parameters
from services.sim import BaseParameters, JointParameters
from services.sim.base.settings import configured

IMPLIED = ("router", "params", "sim", "grader")
"""Services that every fleet has; a fleet file states one only to set its parameters."""

ONLOOKERS = ("panel",)
"""Services on which nothing in a run depends, nor anything that it leaves: what they miss is not the run's loss."""


class Terms(msgspec.Struct, frozen=True, kw_only=True):
    """What the command line adds to a fleet file: where results go, the network, whether to open a viewer.

    ``saved`` is the file of what parameters were set to; without one that is known for the run alone. The router
    joins those at ``links``, and listens at ``listen`` as well; ``insecure`` allows addresses beyond this machine.
    """

    folder: Path
    saved: Path | None = None
    domain: str = ""
    links: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    insecure: bool = False
    view: bool = True


def endpoint(fleet: Fleet) -> str:
    """Where the fleet's router listens for the processes of this user."""
    return router_endpoint(fleet.run.port)


def open_endpoints(fleet: Fleet, terms: Terms) -> tuple[str, ...]:
    """Where it listens for others, too."""
    own = (f"tcp/127.0.0.1:{fleet.run.port}",) if fleet.run.tcp else ()
    return (*own, *(each for each in terms.listen if each not in own))


class Nodes(msgspec.Struct, frozen=True, kw_only=True):
    """The nodes of a fleet by what they are to others.

    ``members`` are those that lockstep waits for at each tick, ``awaits`` all for which time waits to begin,
    ``requires`` those of them without which it does not begin, ``readers`` those whose losses the run answers for.
    """

    members: tuple[str, ...] = ()
    awaits: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    readers: tuple[str, ...] = ()


def wired(kind: str, fleet: Fleet, terms: Terms, nodes: Nodes) -> dict[str, Any]:
    """The parameters that a service gets from the fleet; its own table in the fleet file wins over them."""
    run, robots = fleet.run, fleet.robot
    match kind:
        case "router":
            return {
                "listen": endpoint(fleet),
                "also": list(open_endpoints(fleet, terms)),
                "insecure": terms.insecure,
                "link": list(terms.links),
            }
        case "params":
            return {
                "file": str(terms.saved) if terms.saved is not None else "",
                "schedule": [msgspec.to_builtins(each) for each in fleet.change],
            }
        case "sim":
            return {
                "robots": [_entry(each) for each in robots],
                "mode": run.mode,
                "factor": run.factor,
                "latency": run.latency,
                "seed": run.seed,
                "members": list(nodes.members),
                "awaits": [each for each in nodes.awaits if each not in nodes.members],
                "requires": list(nodes.requires),
                "stops_file": str(terms.folder / STOPS_FILE),
            }
        case "grader":
            return {
                "robots": [each.name for each in robots],
                "halting": [_halting(each) for each in robots if read_model(each.model).wheels],
                "arms": graded_arms(fleet),
                "ends": run.ends,
                "not_before": not_before(fleet),
                "duration": run.duration,
                "readers": list(nodes.readers),
                "output": str(terms.folder),
            }
        case "logger":
            viewer = {} if terms.view else {"view": "never", "serve": False}
            return {
                "robots": [each.name for each in robots],
                "models": [each.model for each in robots] or ["burger"],
                "states": states(fleet),
                # In lockstep all wait for the simulation, which in lab needs a tenth more CPU for its lasers.
                "scans": run.mode != "lockstep",
                "file": str(terms.folder / RECORDING_FILE),
                **_live_port(run.port),
                **viewer,
            }
        case "recorder":
            return {"output": str(terms.folder / BAG_FOLDER), "members": list(nodes.members), "resume": True}
        case "panel":
            return {"address": str(terms.folder / PANEL_FILE)}
        case _:
            return {}


def _live_port(router: int) -> dict[str, int]:
    """The port of the live view: it lies as far from the usual one as the router's, so that two fleets have two."""
    port = LoggerParameters().port + router - PORT
    return {"port": port} if router != PORT and 1024 <= port <= 65535 else {}


def _entry(robot: Robot) -> dict[str, Any]:
    pose = {"x": robot.pose.x, "y": robot.pose.y, "yaw": robot.pose.yaw}
    table = "parameters" if read_model(robot.model).wheels else "joint_parameters"
    return {"name": robot.name, "model": robot.model, **pose, table: robot.parameters}


def parameters_of(model: str) -> type[Parameters]:
    """What a robot of this model takes for parameters."""
    return BaseParameters if read_model(model).wheels else JointParameters


def _halting(robot: Robot) -> dict[str, Any]:
    """How the base of a robot stops when its commander falls silent: by its parameters, else by its model."""
    base = configured(robot.model, build(BaseParameters, robot.parameters)).parameters
    return {"name": robot.name, "timeout": base.cmd_vel_timeout, "brake": base.brake}
