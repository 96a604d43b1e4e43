"""The fleet file as typed records: robots, services and settings of a run; fleets/README.md documents every key."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from deploy.report.checks import Bound, Bounds
from deploy.restart_policy import RestartMode, RestartPolicy
from models import display_name
from models.angles import Angle
from services.runtime.transport.zenoh_config import PORT
from services.sim.engines import Engine

Mode = Literal["lockstep", "real"]
MODES: tuple[Mode, ...] = get_args(Mode)
REMOVED_MODES = {
    "free": "there is no mode 'free' any more, as no controller could keep up with it. Use lockstep: it runs as fast "
    "as the machine can, and waits for the controllers; without any it runs at full speed. real follows the wall "
    "clock, at any factor"
}
"""Error texts for removed modes."""

EndCondition = Literal["goals", "duration", "never"]
Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4, extra={"unit": "m"})]
FleetName = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*\Z", max_length=64)]
"""A name used for folders and files: of the results, and of the saved parameters."""


GroupName = Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*\Z", max_length=64)]
"""The name of a process that several services share."""


class FleetTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a fleet file; an unknown key is an error."""


class StartPose(FleetTable, frozen=True, kw_only=True):
    """The start pose of a robot in the world: m, m, m, rad. An imported robot is raised to stand on the ground."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Coordinate = 0.0
    yaw: Angle = 0.0


class RunConfig(FleetTable, frozen=True, kw_only=True):
    """The run: time mode, physics engine, duration and network.

    ``engine``: PyBullet if None and installed. ``port`` distinguishes the fleets of a user. With ``tcp`` the router
    also listens on 127.0.0.1 at this port, for every user of the machine. With ``share``, services that can share a
    process do, at most this many in each. ``packages`` are folders in which ``package://`` of robots and ``model://``
    of worlds are searched.
    """

    mode: Mode = "lockstep"
    factor: Annotated[float, Meta(gt=0, le=1000)] = 1.0
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    duration: Annotated[float, Meta(ge=0, le=1e7, extra={"unit": "s"})] = 0.0
    ends: EndCondition = "goals"
    latency: Annotated[int, Meta(ge=0, le=1)] = 0
    engine: Engine | None = None
    topology: Literal["auto", "direct", "star"] = "auto"
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    tcp: bool = False
    share: Annotated[int, Meta(ge=2, le=1000)] | None = None
    packages: tuple[str, ...] = ()


class ServiceConfig(FleetTable, frozen=True, kw_only=True):
    """One service; by default its name is its kind, and its namespace that of its robot.

    ``from_start`` names parameters that hold points [x, y] relative to the robot's start, which are shifted to it;
    ``from_robot`` names those that get the ``goals`` of the robot. ``models`` limits a service of every robot to robots
    of these models, by ``models.display_name``. ``args``, ``environment``, ``cwd`` and ``frame_prefix`` are for ROS
    scripts: the arguments after the file's name, environment variables, the working directory (by default the run's
    folder), and the prefix of its robot's frames, e.g. ``tb3_0/``. With ``output`` "screen", the service's output is
    shown as well as logged. ``share`` makes services share processes: as a number, those of their kind, at most this
    many in each; as a name, all with that name.
    """

    kind: str
    name: str = ""
    namespace: str = ""
    parameters: dict[str, Any] = {}
    remap: dict[str, str] = {}
    from_start: tuple[str, ...] = ()
    from_robot: tuple[str, ...] = ()
    models: tuple[str, ...] = ()
    required: bool | None = None
    restart: RestartMode | RestartPolicy | None = None
    args: tuple[str, ...] = ()
    environment: dict[str, str] = {}
    cwd: str = ""
    frame_prefix: str = ""
    output: Literal["log", "screen"] = "log"
    share: Annotated[int, Meta(ge=1, le=1000)] | GroupName | None = None


class ReferenceConfig(FleetTable, frozen=True, kw_only=True):
    """The set-point that a program publishes for an arm.

    ``topic`` is relative to the robot's namespace; ``type`` and ``unit`` are those of its data; ``joint`` defaults to
    the arm's first joint with limits.
    """

    topic: str
    type: Literal["std_msgs/Float32", "std_msgs/Float64"] = "std_msgs/Float64"
    unit: Literal["rad", "deg"] = "rad"
    joint: str = ""


class RobotConfig(FleetTable, frozen=True, kw_only=True):
    """One robot, the parameters of its base or joints, and the services in its namespace.

    ``model`` is a name of ``models/`` or, in the file, a path; once the file is read, it is the robot's
    ``models.robot_source.RobotSource.model``. ``xacro_args`` are the arguments of a xacro. ``namespace`` defaults to
    the robot's name; ``/`` is the root. ``frame_prefix`` defaults to the name and a slash. ``joints`` are start
    positions [rad or m], 0 by default. ``goals`` are points [m] in the world, for services that ask for them.
    ``reference`` is the set-point by which an arm is graded if no controller of the fleet moves it.
    """

    name: str
    model: str
    xacro_args: dict[str, str | float | int | bool] = {}
    namespace: str = ""
    frame_prefix: str | None = None
    pose: StartPose = StartPose()
    joints: dict[str, float] = {}
    goals: tuple[tuple[Coordinate, Coordinate], ...] = ()
    reference: ReferenceConfig | None = None
    parameters: dict[str, Any] = {}
    services: tuple[ServiceConfig, ...] = ()


GoalRule = Literal["none", "shuffle", "mirror", "rotate"]


class GridConfig(FleetTable, frozen=True, kw_only=True):
    """Identical robots ``name_0``, ``name_1``, … in a grid around ``pose``, each with its heading.

    Without ``columns`` the grid is the smallest square. ``goals`` is the rule by which each robot gets a goal: the
    place of another robot, drawn by ``seed`` (shuffle), or its own place mirrored in x (mirror) or rotated by
    180 degrees (rotate) about the grid's centre.
    """

    robots: Annotated[int, Meta(ge=1, le=1000)]
    model: str
    name: str = "robot"
    spacing: Annotated[float, Meta(ge=0.01, le=100, extra={"unit": "m"})] = 1.0
    columns: Annotated[int, Meta(ge=0, le=1000)] = 0
    pose: StartPose = StartPose()
    goals: GoalRule = "none"
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    xacro_args: dict[str, str | float | int | bool] = {}
    parameters: dict[str, Any] = {}
    services: tuple[ServiceConfig, ...] = ()


class ChangeConfig(FleetTable, frozen=True, kw_only=True):
    """A scheduled change of parameters of one set at a simulation time, for this run only."""

    at: Annotated[float, Meta(ge=0, le=1e7, extra={"unit": "s"})]
    set: str
    values: dict[str, Any]


class Fleet(FleetTable, frozen=True, kw_only=True):
    """A fleet.

    ``world`` is a name of models/worlds, or the path of a file; an empty world by default. ``every_robot`` are services
    that each robot gets besides its own. ``grid`` is empty once the file is read: its robots follow those of ``robot``.

    ``rosparam`` is the initial tree of ROS 1 parameters, in the form of ``rosparam load``.

    ``mode_bounds`` are the tables ``[bounds.real]`` and ``[bounds.lockstep]`` of the file. ``folder`` is the file's
    folder, to which its paths are relative.
    """

    name: FleetName
    description: str = ""
    world: Annotated[str, Meta(max_length=4096)] = ""
    run: RunConfig = RunConfig()
    robot: tuple[RobotConfig, ...] = ()
    grid: tuple[GridConfig, ...] = ()
    every_robot: tuple[ServiceConfig, ...] = ()
    service: tuple[ServiceConfig, ...] = ()
    change: tuple[ChangeConfig, ...] = ()
    rosparam: dict[str, Any] = {}
    bounds: dict[str, float | int | Bound] = {}
    mode_bounds: dict[Mode, dict[str, float | int | Bound]] = {}
    folder: str = ""

    def active_bounds(self) -> Bounds:
        """Return the bounds of a run in the fleet's mode; those of the mode override the general ones."""
        return {**self.bounds, **self.mode_bounds.get(self.run.mode, {})}

    def shared_services(self, robot: RobotConfig) -> tuple[tuple[int, ServiceConfig], ...]:
        """Return the services of ``every_robot`` that a robot gets, each with its index in the file."""
        return tuple(
            (index, each)
            for index, each in enumerate(self.every_robot)
            if not each.models or display_name(robot.model) in each.models
        )
