"""Drives a robot in an empty world without a network, and measures its motion against the command.

The tests of this project's own models and ``elea model check`` use the same mathematics. A robot is driven as in the
simulation: one step of the drive before each physics step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from messages.se2 import Pose2
from messages.se3 import rotate_inverse
from services.runtime.step import STEP_S
from services.sim.drive.driver import AT_REST, Drive, DriveState, commanded_velocity, step_drive, wheel_speeds
from services.sim.drive.odometry import OdometryState, initial_odometry, integrate_arc, integrate_encoders
from services.sim.drive.planar_velocity import set_planar_velocity
from services.sim.drive.side_grip import SideGrip
from services.sim.drive.steering import SteeringServo
from services.sim.physics.world import BodyState, World

SETTLE_S = 1.0
"""Time in which a robot comes to rest before and after a manoeuvre, s."""
SLOWEST = 60.0
"""Maximum duration of a manoeuvre, s."""


def yaw_of(state: BodyState) -> float:
    """Return the heading of a body, rad."""
    x, y, z, w = state.orientation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def tilt_of(state: BodyState) -> float:
    """Return the angle of a body's z axis from the vertical, rad."""
    x, y, _, _ = state.orientation
    return 2 * math.asin(min(1.0, math.hypot(x, y)))


def turned(states: Sequence[BodyState]) -> float:
    """Return the angle by which a body turned from the first state to the last, unbounded, rad."""
    return sum(math.remainder(b - a, math.tau) for a, b in pairwise(map(yaw_of, states)))


@dataclass
class DrivenRobot:
    """A base under constant commands.

    ``per_wheel`` converts the speeds of the left and right side to those of its motors; ``side_grip`` is set for a
    skid-steered base, ``servo`` for one with steered wheels.
    """

    world: World
    name: str
    drive: Drive
    state: DriveState = field(default=AT_REST)
    per_wheel: Callable[[tuple[float, float]], Sequence[float]] = tuple
    side_grip: SideGrip | None = None
    servo: SteeringServo | None = None

    def set(self, v: float, w: float, *, vy: float = 0.0, braking: bool = False) -> None:
        """Apply a command for the next physics step."""
        after = step_drive(self.drive, self.state, v, w, braking, STEP_S, vy)
        if self.drive.holonomic:
            self.state = after
            set_planar_velocity(self.world.body(self.name), after.v, after.vy, after.w)
        elif self.servo is not None:
            self.state = after
            wheels = self.per_wheel(wheel_speeds(self.drive, after))
            self.world.body(self.name).set_speeds((*wheels, *self.servo.speeds(after.steer)))
        elif after is not self.state:
            self.state = after
            self.world.body(self.name).set_speeds(self.per_wheel(wheel_speeds(self.drive, after)))
        if self.side_grip is not None:
            self.side_grip.step()

    @property
    def velocity(self) -> tuple[float, float, float]:
        """The command after all limits: forward and sideways [m/s], turn rate [rad/s]."""
        if self.drive.holonomic:
            return self.state.v, self.state.vy, self.state.w
        v, w = commanded_velocity(self.drive, self.state)
        return v, 0.0, w


def drive_robots(
    drivers: Sequence[DrivenRobot], v: float, w: float, seconds: float, *, vy: float = 0.0, braking: bool = False
) -> list[BodyState]:
    """Apply a command to all robots for a time; return the states of the first one after each step."""
    states = []
    for _ in range(round(seconds / STEP_S)):
        for each in drivers:
            each.set(v, w, vy=vy, braking=braking)
        drivers[0].world.step()
        states.append(drivers[0].world.body(drivers[0].name).state())
    return states


@dataclass(frozen=True)
class Manoeuvre:
    """The commanded and the actual motion of a robot from rest to rest.

    ``commanded``, ``actual`` and ``counted`` (by wheel encoders, None without) are along the commanded axis: m, or rad
    for a turn. ``aside`` [m] is the distance from the line, or from the spot, ``heading`` [rad] the unintended turn,
    ``tilt`` [rad] the largest change of the tilt since the start. ``commanded`` is less than the requested amount if
    the robot is too slow for it.
    """

    commanded: float
    actual: float
    aside: float
    heading: float
    tilt: float
    counted: float | None = None

    @property
    def error(self) -> float:
        """Relative error of the motion: (actual - commanded) / commanded."""
        return self.actual / self.commanded - 1 if self.commanded else 0.0


Encoders = Callable[[Mapping[str, float]], tuple[float, float]]
"""Returns the mean angles of the left and the right wheels, from those of the joints by name."""


def drive_straight(robot: DrivenRobot, distance: float, speed: float, encoders: Encoders | None = None) -> Manoeuvre:
    """Drive ahead from rest to rest."""
    return _manoeuvre(robot, distance, (speed, 0.0, 0.0), encoders)


def drive_sideways(robot: DrivenRobot, distance: float, speed: float) -> Manoeuvre:
    """Drive to the left from rest to rest."""
    return _manoeuvre(robot, distance, (0.0, speed, 0.0), None)


def turn_on_the_spot(robot: DrivenRobot, angle: float, rate: float, encoders: Encoders | None = None) -> Manoeuvre:
    """Turn to the left from rest to rest."""
    return _manoeuvre(robot, angle, (0.0, 0.0, rate), encoders)


def drive_circle(robot: DrivenRobot, angle: float, speed: float, rate: float, encoders: Encoders) -> Manoeuvre:
    """Turn to the left on a circle from rest to rest; ``aside`` is the distance from the commanded end."""
    return _manoeuvre(robot, angle, (speed, 0.0, rate), encoders)


def _manoeuvre(
    robot: DrivenRobot, amount: float, velocity: tuple[float, float, float], encoders: Encoders | None
) -> Manoeuvre:
    """Command a velocity until the limited command, including the way to a stop, adds up to ``amount``."""
    axis = max(each for each in range(3) if velocity[each])
    body = robot.world.body(robot.name)
    drive_robots([robot], 0.0, 0.0, SETTLE_S)
    states, counter = [body.state()], _Counter(robot, encoders)
    commanded = stopping = 0.0
    driving, commanded_pose, stopping_state = True, Pose2(0.0, 0.0, 0.0), None
    for _ in range(round(SLOWEST / STEP_S)):
        before = robot.velocity[axis]
        command = velocity if driving else (0.0, 0.0, 0.0)
        robot.set(command[0], command[2], vy=command[1])
        robot.world.step()
        states.append(body.state())
        counter.update()
        now = robot.velocity[axis]
        commanded += now * STEP_S
        commanded_pose = integrate_arc(*commanded_pose, robot.velocity[0] * STEP_S, robot.velocity[2] * STEP_S)
        if driving:
            if robot.state is not stopping_state:  # at a constant speed it stays the same
                stopping, stopping_state = _stopping_distance(robot, axis), robot.state
            driving = commanded + stopping < amount
        elif not now and not before:
            break
    states += drive_robots([robot], 0.0, 0.0, SETTLE_S)
    counter.update()
    start, end = states[0], states[-1]
    dx, dy, dz = (b - a for a, b in zip(start.position, end.position, strict=True))
    ahead, left, _ = rotate_inverse(start.orientation, (dx, dy, dz))
    turn = turned(states)
    actual = (ahead, left, turn)[axis]
    aside = math.hypot(ahead - commanded_pose.x, left - commanded_pose.y) if axis == 2 else abs((left, ahead)[axis])
    upright = tilt_of(start)
    return Manoeuvre(
        commanded=commanded,
        actual=actual,
        aside=aside,
        heading=0.0 if axis == 2 else turn,
        tilt=max(abs(tilt_of(each) - upright) for each in states),
        counted=counter.along(axis),
    )


def _stopping_distance(robot: DrivenRobot, axis: int) -> float:
    """Return the distance [m or rad] that the limited command still covers if it stops from now on."""
    state, distance = robot.state, 0.0
    for _ in range(round(SLOWEST / STEP_S)):
        after = step_drive(robot.drive, state, 0.0, 0.0, False, STEP_S)
        if after is state:
            return distance
        state = after
        if robot.drive.holonomic:
            velocity = (state.v, state.vy, state.w)
        else:
            v, w = commanded_velocity(robot.drive, state)
            velocity = (v, 0.0, w)
        distance += velocity[axis] * STEP_S
    return distance


class _Counter:
    """Wheel odometry during a manoeuvre."""

    def __init__(self, robot: DrivenRobot, encoders: Encoders | None) -> None:
        self._robot, self._encoders = robot, encoders
        self._state: OdometryState | None = initial_odometry(*self._angles()) if encoders is not None else None

    def update(self) -> None:
        if self._state is not None:
            self._state = integrate_encoders(self._state, *self._angles(), STEP_S, self._robot.drive.geometry)

    def along(self, axis: int) -> float | None:
        """Return the counted motion: m ahead, or rad; None sideways or without encoders."""
        if self._state is None or axis == 1:
            return None
        pose: Pose2 = self._state.pose
        return pose.x if axis == 0 else self._state.heading

    def _angles(self) -> tuple[float, float]:
        assert self._encoders is not None
        body = self._robot.world.body(self._robot.name)
        angles = dict(zip(body.joints, body.joint_readings().position, strict=True))
        return self._encoders(angles)


@dataclass(frozen=True)
class JointTrial:
    """A joint that moves there and back, each by ``commanded`` [rad or m]: how far it came, and its final distance from
    the start.
    """

    joint: str
    commanded: float
    actual: float
    back: float

    @property
    def error(self) -> float:
        """Relative error of the move there: (actual - commanded) / commanded."""
        return self.actual / self.commanded - 1 if self.commanded else 0.0


def shake_joints(
    world: World, name: str, motors: Sequence[str], moves: Mapping[str, float], seconds: float = 1.0
) -> list[JointTrial]:
    """Move each joint of ``moves`` by its amount [rad or m] and back, each way in ``seconds``, one after the other.

    The speed is half a sine, with a maximum of pi/2 times the mean. In the meantime the motors, in the order of
    ``motors``, hold all other joints.
    """
    body, trials = world.body(name), []
    rest = [0.0] * len(motors)
    for joint, move in moves.items():
        index = body.joints.index(joint)
        positions = [body.joint_readings().position[index]]
        for sign in (1.0, -1.0):
            speeds, steps = list(rest), round(seconds / STEP_S)
            for step in range(steps):
                share = math.pi / 2 * math.sin(math.pi * (step + 0.5) / steps)
                speeds[motors.index(joint)] = sign * move / seconds * share
                body.set_speeds(speeds)
                world.step()
            body.set_speeds(rest)
            world.step()
            positions.append(body.joint_readings().position[index])
        start, there, back = positions
        trials.append(JointTrial(joint, move, there - start, back - start))
    return trials
