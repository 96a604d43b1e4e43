"""Checks a robot's model for ``elea model check``: what is understood, what looks wrong, and how it drives."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import unquote

from messages.se3 import Pose3
from models import physics_urdf_path
from models.gazebo_tags import GazeboTags, Transmission, parse_gazebo_tags
from models.inertia_check import inertia_doubt, inertia_fault
from models.mesh import Mesh, read_mesh
from models.model import RobotModel, read_model
from models.robot_cache import is_imported
from models.robot_facts import RobotFacts, read_facts
from models.robot_source import RobotSource, resolve_robot
from models.shapes import LinkShapes, read_shapes
from models.urdf import Joint, Link, RobotDescription, parse_urdf, parse_xml, read_urdf
from models.wheels import is_continuous, read_wheel
from models.world import WorldDescription
from models.xacro_file import XacroValue
from services.runtime.step import STEP_NS
from services.sim.adaptation import AdaptedBody, adapt_body
from services.sim.drive.config import DriveConfig, robot_config
from services.sim.drive.steering import SteeringServo
from services.sim.driving_trial import (
    DrivenRobot,
    JointTrial,
    Manoeuvre,
    drive_circle,
    drive_sideways,
    drive_straight,
    shake_joints,
    turn_on_the_spot,
)
from services.sim.engines import default_engine, open_world
from services.sim.parameters import BaseParameters
from services.sim.physics.world import Body, Motor, World

STRAIGHT = 0.02
"""Maximum relative error of driving 1 m, and maximum distance aside, m."""
TURN = 0.05
"""Maximum relative error of a turn of 360 degrees."""
SWAY = math.radians(5)
"""rad; maximum turn while driving straight ahead."""
TILT = math.radians(10)
"""rad; a robot that tilts by more falls or hops."""
DRIFT = 0.05
"""m; maximum distance from the spot after turning on it."""
JOINT = 0.1
"""Maximum error of a joint's move, as a share of it."""
HANGS = 0.003
"""m; a wheel higher above the ground does not touch it."""
SHAKE = 0.3
"""rad or m; the largest move of a joint."""
SHAKE_SPEED = 1.0
"""rad/s or m/s; the highest speed of a move."""
LIFT = 2.0
"""m; height of a robot's base, held there while its joints are moved."""
SHAKE_EFFORT = 1000.0
"""N m or N, for a joint without an effort limit."""


@dataclass(frozen=True)
class BaseFacts:
    """A base: lengths in m, speeds in m/s and rad/s. ``shape_radius`` and ``track`` are measured on the shapes."""

    kind: str
    left_joints: tuple[str, ...] = ()
    right_joints: tuple[str, ...] = ()
    radius: float | None = None
    shape_radius: float | None = None
    separation: float | None = None
    track: float | None = None
    separation_multiplier: float = 1.0
    max_linear: float = 0.0
    max_angular: float = 0.0
    acceleration: float = 0.0
    torque: float | None = None
    odometry: str = ""


@dataclass(frozen=True)
class JointFacts:
    """A movable joint: its limits in rad, m, N m, N, and the role and interfaces by which it is moved."""

    name: str
    type: str
    role: str
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    interfaces: tuple[str, ...] = ()


@dataclass(frozen=True)
class SensorFacts:
    """A sensor: its topic, its link, the frame of its messages, and its figures as text."""

    kind: str
    topic: str
    link: str
    frame: str
    figures: str


@dataclass(frozen=True)
class TrialFacts:
    """A manoeuvre or joint move: commanded and actual motion (m, rad or deg), relative ``error``, and the verdict."""

    name: str
    unit: str
    commanded: float
    actual: float
    error: float
    remark: str
    ok: bool
    counted: float | None = None


@dataclass(frozen=True)
class ModelCheck:
    """The result of a check.

    ``broken`` has what must be fixed, ``doubts`` what is unlikely to be right, ``notes`` what was assumed or is
    simulated differently from the file, ``ignored`` what was not understood.
    """

    name: str
    file: str
    about: str
    root: str
    mass: float
    links: int
    radius: float
    height: float
    fixed_base: bool
    base: BaseFacts | None
    sensors: tuple[SensorFacts, ...]
    joints: tuple[JointFacts, ...]
    transmissions: tuple[Transmission, ...]
    friction: dict[str, float]
    topics: dict[str, str]
    notes: tuple[str, ...]
    ignored: tuple[str, ...]
    doubts: tuple[str, ...]
    broken: tuple[str, ...]
    trials: tuple[TrialFacts, ...] = ()
    advice: tuple[str, ...] = field(default=())

    @property
    def ok(self) -> bool:
        """Whether nothing is broken and every trial succeeded."""
        return not self.broken and all(each.ok for each in self.trials)


@dataclass(frozen=True)
class _Robot:
    """A robot and everything read about it."""

    source: RobotSource
    model: RobotModel
    description: RobotDescription
    shapes: Mapping[str, LinkShapes]
    tags: GazeboTags
    facts: RobotFacts

    @property
    def file(self) -> str:
        """The file name shown in messages about its problems."""
        return Path(self.facts.origin or self.source.urdf).name


def check_model(
    name: str,
    base: Path,
    drive: bool = True,
    packages: Sequence[Path] = (),
    xacro_args: Mapping[str, XacroValue] | None = None,
) -> ModelCheck:
    """Check a model, given by its name or by a file, see ``models.robot_source.resolve_robot``.

    Raises:
        BadInput: It cannot be read at all.
    """
    faults: list[str] = []
    source = resolve_robot(name, base, packages, xacro_args, faults=faults)
    robot = _read(source)
    check = _describe(robot, [f"{robot.file}: {each}" for each in faults])
    return _with_trials(check, robot) if drive else check


def _read(source: RobotSource) -> _Robot:
    text = read_urdf(source.urdf)
    imported = is_imported(source.model)

    def mesh(uri: str) -> Mesh:
        return read_mesh(Path(unquote(uri.removeprefix("file://"))))

    return _Robot(
        source=source,
        model=read_model(source.model),
        description=parse_urdf(text),
        shapes=read_shapes(parse_xml(text), mesh, []),
        tags=parse_gazebo_tags(text, source.urdf.name),
        facts=read_facts(source.model) if imported else RobotFacts(name=source.name, origin=str(source.urdf)),
    )


def _describe(robot: _Robot, faults: Sequence[str]) -> ModelCheck:
    model, facts = robot.model, robot.facts
    broken = [*faults, *(f"{robot.file}: {each}" for link in robot.description.links for each in _faults(link, robot))]
    if model.wheels is not None:
        lowest = min(_gap(each, robot) for each in (*model.wheels.left_joints, *model.wheels.right_joints))
        if lowest > HANGS:
            broken.append(
                f"{robot.file}: no driven wheel touches the ground, the lowest is {1000 * lowest:.1f} mm above it"
            )
    doubts = [f"{robot.file}: {each}" for link in robot.description.links for each in _doubts(link, robot)]
    if model.has_base:
        settings = robot_config(robot.source.model, BaseParameters()).drive_config
        doubts += settings.warnings if settings is not None else ()
    return ModelCheck(
        name=robot.description.name,
        file=facts.origin,
        about=model.about,
        root=robot.description.root,
        mass=sum(each.inertia.mass for each in robot.description.links),
        links=len(robot.description.links),
        radius=model.radius,
        height=facts.height,
        fixed_base=model.fixed_base,
        base=_base(robot),
        sensors=tuple(_sensors(model)),
        joints=tuple(_joints(robot)),
        transmissions=robot.tags.transmissions,
        friction={link: value for link, each in robot.tags.friction.items() if (value := each.coefficient) is not None},
        topics=dict(model.topics),
        notes=facts.notes,
        ignored=facts.ignored,
        doubts=tuple(doubts),
        broken=tuple(broken),
    )


def _base(robot: _Robot) -> BaseFacts | None:
    model = robot.model
    if not model.has_base:
        return None
    config = robot_config(robot.source.model, BaseParameters())
    settings = config.drive_config
    assert settings is not None
    base = model.wheels or model.planar
    assert base is not None
    if model.wheels is None:
        return BaseFacts(
            "holonomic",
            max_linear=base.max_linear,
            max_angular=base.max_angular,
            acceleration=base.acceleration,
            odometry=model.odometry,
        )
    joints = {each.name: each for each in robot.description.joints}
    sides = [
        [read_wheel(robot.description, robot.shapes, joints[each]) for each in side]
        for side in (settings.left_joints, settings.right_joints)
    ]
    radii = [each.radius for side in sides for each in side]
    left, right = (sum(each.place[1] for each in side) / len(side) for side in sides)
    return BaseFacts(
        "steered" if model.wheels.steering else "differential" if len(settings.left_joints) == 1 else "skid steer",
        settings.left_joints,
        settings.right_joints,
        radius=settings.geometry.left_radius,
        shape_radius=max(radii),
        separation=settings.geometry.separation,
        track=left - right,
        separation_multiplier=settings.live.wheel_separation_multiplier,
        max_linear=base.max_linear,
        max_angular=base.max_angular,
        acceleration=base.acceleration,
        torque=settings.torque,
        odometry=model.odometry,
    )


def _sensors(model: RobotModel) -> Iterator[SensorFacts]:
    if (laser := model.laser) is not None:
        end = laser.angle_min + (laser.samples - 1) * laser.increment
        yield SensorFacts(
            "laser",
            "scan",
            laser.link,
            laser.mount.frame or laser.link,
            f"{laser.samples} rays from {math.degrees(laser.angle_min):.4g} to {math.degrees(end):.4g} deg, "
            f"{laser.range_min:g} to {laser.range_max:g} m, {laser.rate:.3g} Hz, noise {laser.noise:g} m",
        )
    if (sonar := model.sonar) is not None:
        yield SensorFacts("sonar", "sonar", sonar.link, sonar.link, f"{len(sonar.links)} sonars, {sonar.rate:.3g} Hz")
    if (imu := model.imu) is not None:
        noise = f"noise {imu.gyro_noise:g} rad/s, {imu.acceleration_noise:g} m/s2"
        yield SensorFacts("imu", "imu", imu.link, imu.mount.frame or imu.link, f"{imu.rate:.3g} Hz, {noise}")
    if (camera := model.camera) is not None:
        yield SensorFacts(
            "camera",
            "camera/image",
            camera.link,
            camera.mount.frame or camera.link,
            f"{camera.width} x {camera.height}, {math.degrees(camera.fov):.3g} deg, {camera.rate:.3g} Hz",
        )


def _joints(robot: _Robot) -> Iterator[JointFacts]:
    model = robot.model
    driven = {*model.wheels.left_joints, *model.wheels.right_joints} if model.wheels is not None else set()
    steering = model.wheels.steering if model.wheels is not None else None
    steered = {each.joint for each in steering.wheels} if steering is not None else set()
    interfaces: dict[str, list[str]] = {}
    for transmission in robot.tags.transmissions:
        for name in transmission.joints:
            interfaces.setdefault(name, []).extend(transmission.interfaces)
    for joint in robot.description.joints:
        if joint.kind == "fixed":
            continue
        limits = joint.limits
        if joint.name in driven:
            role = "wheel"
        elif joint.name in steered:
            role = "steering"
        elif joint.mimic is not None:
            role = f"follows {joint.mimic.joint}"
        elif joint.name in interfaces:
            role = "transmission"
        else:
            role = "free" if model.has_base else "effort"
        commands = tuple(dict.fromkeys(interfaces.get(joint.name, ())))
        yield JointFacts(
            joint.name, joint.kind, role, limits.lower, limits.upper, limits.effort, limits.velocity, commands
        )


def _faults(link: Link, robot: _Robot) -> Iterator[str]:
    above = next((each for each in robot.description.joints if each.child == link.name), None)
    if not has_inertial(link):
        if above is not None and above.kind != "fixed":
            yield f"link {link.name!r} has no mass although joint {above.name!r} moves it: Gazebo ignores such links"
    elif fault := inertia_fault(link.inertia):
        yield f"link {link.name!r}: {fault}"


def _doubts(link: Link, robot: _Robot) -> Iterator[str]:
    own = robot.shapes[link.name]
    box = own.box()
    if not has_inertial(link):
        if own.collisions and link.name != robot.description.root:
            yield f"link {link.name!r} has a collision shape but no mass"
    elif box is not None and not inertia_fault(link.inertia):
        x, y, z = (box[1] - box[0]).tolist()
        if doubt := inertia_doubt(link.inertia, (x, y, z)):
            yield f"link {link.name!r}: {doubt}"


def has_inertial(link: Link) -> bool:
    """Return whether a URDF states any inertia of a link."""
    return link.inertia.mass != 0 or any(link.inertia.tensor)


def _gap(name: str, robot: _Robot) -> float:
    """Return the height of a wheel's lowest point above the ground, m."""
    joint = next(each for each in robot.description.joints if each.name == name)
    wheel = read_wheel(robot.description, robot.shapes, joint)
    return wheel.place[2] - wheel.radius + robot.facts.height


def _with_trials(check: ModelCheck, robot: _Robot) -> ModelCheck:
    """Add the results of trials in an empty world."""
    trials: list[TrialFacts] = []
    advice: list[str] = []
    if robot.model.has_base:
        settings = robot_config(robot.source.model, BaseParameters()).drive_config
        assert settings is not None
        trials += _drive(robot, settings, advice)
    trials += _shake(robot)
    return replace(check, trials=tuple(trials), advice=tuple(advice))


def _body(robot: _Robot, motors: tuple[Motor, ...], fixed: bool = False) -> AdaptedBody:
    urdf, pose = physics_urdf_path(robot.source.model), Pose3((0.0, 0.0, robot.facts.height))
    return adapt_body(Body("robot", urdf, pose, motors, robot.model.fixed_base or fixed), robot.source.model)


def driven_robot(world: World, body: AdaptedBody, settings: DriveConfig) -> DrivenRobot:
    """Spawn a robot, ready to be driven."""
    handle = world.spawn(body.body)
    steering = settings.drive.steering
    return DrivenRobot(
        world,
        body.body.name,
        settings.drive,
        per_wheel=settings.per_wheel,
        side_grip=body.side_grip(handle),
        servo=None if steering is None else SteeringServo(handle, steering),
    )


def _drive(robot: _Robot, settings: DriveConfig, advice: list[str]) -> Iterator[TrialFacts]:
    motors, steering = settings.motors, settings.drive.steering
    encoders = settings.side_means if motors else None
    base = robot.model.wheels or robot.model.planar
    assert base is not None
    speed, rate = min(base.max_linear, 0.5), min(base.max_angular, 1.0)
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:

        def fresh() -> DrivenRobot:
            if world.names:
                world.delete("robot")
            return driven_robot(world, _body(robot, motors), settings)

        yield _straight("1 m straight", drive_straight(fresh(), 1.0, speed, encoders))
        if robot.model.planar is not None:
            yield _straight("1 m sideways", drive_sideways(fresh(), 1.0, speed))
        if steering is not None:
            k = 0.7 * steering.curvature(steering.max_angle)
            speed = min(speed, rate / k)
            circle = drive_circle(fresh(), math.tau, speed, speed * k, settings.side_means)
            # A circle that misses TURN of its angle ends that share of its length from the start.
            yield _turn(circle, "360 deg on a circle", max(DRIFT, TURN * math.tau / k))
            return
        spin = turn_on_the_spot(fresh(), math.tau, rate, encoders)
        yield _turn(spin)
        if spin.actual > 0.1 and abs(spin.error) > 0.01 and robot.model.wheels is not None:
            now = settings.live.wheel_separation_multiplier
            advice.append(
                f"wheel_separation_multiplier = {now * spin.commanded / spin.actual:.4g} would turn it exactly"
            )


def _straight(name: str, done: Manoeuvre) -> TrialFacts:
    ok = (
        abs(done.error) <= STRAIGHT
        and done.aside <= STRAIGHT
        and abs(done.heading) <= SWAY
        and done.tilt <= TILT
        and done.commanded > 0.9
    )
    remark = f"{1000 * done.aside:.1f} mm aside, turned {math.degrees(done.heading):.2f} deg"
    return TrialFacts(name, "m", done.commanded, done.actual, done.error, remark + _tilt(done), ok, done.counted)


def _turn(done: Manoeuvre, name: str = "360 deg on the spot", drift: float = DRIFT) -> TrialFacts:
    commanded, actual = math.degrees(done.commanded), math.degrees(done.actual)
    ok = abs(done.error) <= TURN and done.aside <= drift and done.tilt <= TILT and commanded > 350
    counted = None if done.counted is None else math.degrees(done.counted)
    remark = f"{1000 * done.aside:.1f} mm off the spot"
    return TrialFacts(name, "deg", commanded, actual, done.error, remark + _tilt(done), ok, counted)


def _tilt(done: Manoeuvre) -> str:
    return f", tilts {math.degrees(done.tilt):.1f} deg" if done.tilt > math.radians(1) else ""


def _shake(robot: _Robot) -> Iterator[TrialFacts]:
    """Move all joints that are neither wheels nor casters, with the base held."""
    model = robot.model
    driven = {*model.wheels.left_joints, *model.wheels.right_joints} if model.wheels is not None else set()
    chosen = [
        each
        for each in robot.description.joints
        if each.single_dof
        and each.name not in driven
        and each.mimic is None
        and not (model.has_base and is_continuous(each))
    ]
    if not chosen:
        return
    motors = tuple(Motor(each.name, each.limits.effort or SHAKE_EFFORT) for each in chosen)
    moves = {each.name: move for each in chosen if (move := _move(each))}
    units = {each.name: "m" if each.kind == "prismatic" else "rad" for each in chosen}
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:
        # In the air, so that the ground is not in the way.
        body = _body(robot, motors, fixed=True).body
        world.spawn(replace(body, pose=Pose3((0.0, 0.0, LIFT + robot.facts.height))))
        for trial in shake_joints(world, "robot", [each.joint for each in motors], moves):
            yield _joint_trial(trial, units[trial.joint])


def _move(joint: Joint) -> float:
    """Return how far to move a joint from its start: half the way to its farther limit, at most SHAKE."""
    limits, start = joint.limits, joint.limits.clamp(0.0)
    low = -2 * SHAKE if limits.lower is None else limits.lower - start
    high = 2 * SHAKE if limits.upper is None else limits.upper - start
    move = min(SHAKE, high / 2) if high >= -low else max(-SHAKE, low / 2)
    most = min(SHAKE_SPEED, limits.velocity or SHAKE_SPEED) * 2 / math.pi
    return max(-most, min(most, move))


def _joint_trial(trial: JointTrial, unit: str) -> TrialFacts:
    ok = abs(trial.error) <= JOINT and abs(trial.back) <= JOINT * abs(trial.commanded)
    remark = f"ends {trial.back:+.4f} from where it began"
    return TrialFacts(trial.joint, unit, trial.commanded, trial.actual, trial.error, remark, ok)
