"""The model of a robot with a URDF but no ``model.toml``: inferred from its tags and geometry, with stated defaults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import msgspec

from messages.errors import unknown_name
from messages.se3 import Vector
from models.dynamics import GRAVITY
from models.extents import bottom, circle_radius, lowest_point, placed_shapes, solid_shapes
from models.gazebo_tags import DriveTag, GazeboTags
from models.model import LaserConfig, PlanarConfig, RobotModel, SteeringConfig, WheelConfig
from models.shapes import LinkShapes
from models.steering import find_steering, steering_config
from models.urdf import NoWheels, RobotDescription
from models.urdf_writer import link_poses
from models.wheels import TOUCHES, Wheel, is_continuous, read_wheel, rolling_joints

MAX_LINEAR = 1.0
"""Maximum speed [m/s] of a base if neither tags nor joints state it."""
MAX_ANGULAR = 3.0
"""Maximum turn rate [rad/s], likewise."""
ACCELERATION = 1.0
"""Maximum acceleration [m/s2]; half of what tips the robot over if that is less."""
BRAKE = 2.0
"""Maximum deceleration [m/s2], likewise."""
MAX_PLAUSIBLE_SPEED = 10.0
"""Speed [m/s] above which a joint's limit means "none"."""


class InferredModel(NamedTuple):
    """A model, and notes on values that were chosen because nothing states them."""

    model: RobotModel
    notes: tuple[str, ...]


def infer_model(
    robot: RobotDescription, shapes: Mapping[str, LinkShapes], tags: GazeboTags, name: str
) -> InferredModel:
    """Infer the model of a robot from its URDF alone; raises BadInput for a drive without its joints or wheels.

    ``name`` is the file name used in notes.
    """
    return _Inference(robot, tags, shapes, name).result()


class _Inference:
    """The steps from tags and geometry to a model."""

    def __init__(self, robot: RobotDescription, tags: GazeboTags, shapes: Mapping[str, LinkShapes], name: str) -> None:
        self._robot, self._tags, self._shapes, self._name = robot, tags, solid_shapes(shapes), name
        self._joints = {each.name: each for each in robot.joints}
        self._notes: list[str] = []
        self._placed = placed_shapes(robot, shapes)
        self._floor = lowest_point(self._placed)

    def result(self) -> InferredModel:
        """Return the model of the robot."""
        tags, robot = self._tags, self._robot
        drive, steering = self._drive()
        drive_table: dict[str, Any] = {}
        wheels = planar = None
        fixed = tags.static or robot.root == "world"
        if drive is not None and drive.kind != "holonomic":
            wheels = self._wheels(drive, drive_table, steering)
        elif drive is not None:
            planar = self._planar(drive)
        if drive is not None:
            drive_table |= self._odometry_table()
        rate = tags.odometry_rate or 50.0
        model = RobotModel(
            about=robot.name or self._name,
            base_frame=robot.root,
            radius=max(0.01, circle_radius(self._placed)),
            odometry="encoder" if wheels is not None and tags.odometry != "world" else "world",
            odometry_rate=min(rate, 50.0),
            joint_rate=tags.joint_rate or (50.0 if drive is not None else 100.0),
            fixed_base=fixed,
            wheels=wheels,
            planar=planar,
            odom_frame=tags.odom_frame or "odom",
            topics=tags.topics,
            drive=drive_table,
            laser=self._laser(tags.laser),
            imu=self._sensor("imu", tags.imu),
            camera=self._sensor("camera", tags.camera),
        )
        self._check_base_frame()
        return InferredModel(model, (*self._notes, *tags.notes))

    def _odometry_table(self) -> dict[str, Any]:
        table: dict[str, Any] = {}
        if self._tags.odometry_rate:
            table["publish_rate"] = self._tags.odometry_rate
        if not self._tags.odom_tf:
            table["enable_odom_tf"] = False
        return table

    def _drive(self) -> tuple[DriveTag | None, SteeringConfig | None]:
        """Return the drive of the robot, by its tags or its wheels, and its steering."""
        stated = self._tags.drive
        if stated is not None and stated.kind != "steered":
            return stated, None
        found = find_steering(self._robot, self._shapes, self._commanded(), self._floor + 2 * TOUCHES)
        if found is not None:
            drive = stated or DriveTag("steered", self._name)
            steered = ", ".join(each.steering.name for each in found.steered)
            pair = f"{found.left.joint}, {found.right.joint}"
            self._notes.append(
                f"{drive.where}: steered by {steered}, driven by {pair}: angular.z of cmd_vel is the turn rate, not "
                "the steering angle"
            )
            backwards = tuple(each.joint for each in (found.left, found.right) if each.direction[1] < 0)
            left, right = (found.left.joint,), (found.right.joint,)
            drive = replace(drive, left_joints=left, right_joints=right, reversed_joints=backwards)
            return drive, steering_config(found, drive.max_steer, self._mass())
        if stated is not None:
            self._notes.append(
                f"{stated.where}: found no steered wheels together with exactly one axle that is not steered"
            )
        return self._guess_drive(), None

    def _commanded(self) -> set[str]:
        """Return the joints of transmissions and of ``<ros2_control>``."""
        return {joint for each in self._tags.transmissions for joint in each.joints}

    def _wheels(self, drive: DriveTag, table: dict[str, Any], steering: SteeringConfig | None) -> WheelConfig:
        sides = drive.left_joints, drive.right_joints
        left, right = ([self._wheel(name, drive.where) for name in side] for side in sides)
        if _mean(each.place[1] for each in left) < _mean(each.place[1] for each in right):
            left, right = right, left
            self._notes.append(f"{drive.where}: the left joints are on the right: the sides are swapped")
        both = [*left, *right]
        radius = drive.radius or max(each.radius for each in both)
        if not radius > 0:
            raise NoWheels(f"{drive.where}: neither the tag nor the wheels' shapes give their radius")
        track = _mean(each.place[1] for each in left) - _mean(each.place[1] for each in right)
        separation = drive.separation or track
        if not separation > 0:
            raise NoWheels(f"{drive.where}: the wheels are not on the left and right of the robot's x axis")
        for each in both:
            if each.direction[1] < 0.5 and each.joint not in drive.reversed_joints:
                self._notes.append(
                    f"{drive.where}: joint {each.joint!r} turns about {_show(each.direction)}, not about the robot's "
                    "y axis: the robot will not drive forwards along x"
                )
        if len(both) > 2 or steering is not None:
            # Here a skid-steered or car-like base turns according to its track; values for Gazebo and real robots often
            # differ.
            factor = track / separation
            if abs(factor - 1) > 0.02:
                table["wheel_separation_multiplier"] = round(min(max(factor, 0.1), 10.0), 4)
                self._notes.append(
                    f"{drive.where}: wheelSeparation {separation:.4g} m is multiplied by {factor:.4g} here: a "
                    f"skid-steered or car-like base turns according to its track of {track:.4g} m"
                )
        fastest = drive.max_linear or self._joint_speed(both) * radius
        if not 0 < fastest <= MAX_PLAUSIBLE_SPEED:
            fastest = MAX_LINEAR
        least = self._tipping()
        rise = drive.acceleration or 0.0
        if rise > max(ACCELERATION, least):
            self._notes.append(
                f"{drive.where}: the acceleration of {rise:g} m/s2 is reduced to {max(ACCELERATION, least):.3g} m/s2: "
                "above half of what tips it over, it slips"
            )
            rise = max(ACCELERATION, least)
        effective = separation * table.get("wheel_separation_multiplier", 1.0)
        tightest = 2 / effective if steering is None else steering.max_curvature
        return WheelConfig(
            left_joint=left[0].joint,
            right_joint=right[0].joint,
            other_left=tuple(each.joint for each in left[1:]),
            other_right=tuple(each.joint for each in right[1:]),
            reversed=drive.reversed_joints,
            steering=steering,
            separation=separation,
            radius=radius,
            max_linear=fastest,
            max_angular=drive.max_angular or min(MAX_ANGULAR, fastest * tightest),
            acceleration=rise if rise > 0 else min(ACCELERATION, least),
            brake=max(rise, min(BRAKE, least)),
            torque=self._torque(drive, both, radius),
        )

    def _wheel(self, name: str, where: str) -> Wheel:
        joint = self._joints.get(name)
        if joint is None or not joint.single_dof:
            raise unknown_name(
                "wheel joint", name, [each.name for each in self._robot.joints if each.single_dof], where
            )
        return read_wheel(self._robot, self._shapes, joint)

    def _planar(self, drive: DriveTag) -> PlanarConfig:
        least = self._tipping()
        return PlanarConfig(
            max_linear=drive.max_linear or MAX_LINEAR,
            max_angular=drive.max_angular or MAX_ANGULAR,
            acceleration=drive.acceleration or min(ACCELERATION, least),
            acceleration_angular=MAX_ANGULAR,
            brake=max(drive.acceleration or 0.0, min(BRAKE, least)),
        )

    def _guess_drive(self) -> DriveTag | None:
        """Return the wheels of a robot whose tags name no drive: pairs of one radius, mounted on the root left and
        right of it, on the ground; only those that transmissions command by velocity, if there are any."""
        moved = {joint for each in self._tags.transmissions if "velocity" in each.interfaces for joint in each.joints}
        mounts = self._mounts()
        wheels = [
            read_wheel(self._robot, self._shapes, joint)
            for joint in rolling_joints(self._robot)
            if joint.parent in mounts and (not moved or joint.name in moved)
        ]
        wheels = [
            each
            for each in wheels
            if each.radius > 0
            and abs(each.direction[1]) > 0.9
            and each.place[2] - each.radius < self._floor + 2 * TOUCHES
            and abs(each.place[1]) > each.radius / 10
        ]
        left = sorted((each for each in wheels if each.place[1] > 0), key=lambda each: -each.place[0])
        right = sorted((each for each in wheels if each.place[1] < 0), key=lambda each: -each.place[0])
        if not left or len(left) != len(right) or len(left) > 4:
            return None
        for one, other in zip(left, right, strict=True):
            uneven = abs(one.place[0] - other.place[0]) + abs(one.place[1] + other.place[1])
            if uneven > 0.02 or abs(one.radius - other.radius) > 0.1 * one.radius:
                return None
        names = ", ".join(each.joint for each in (*left, *right))
        self._notes.append(f"no tag defines a drive: inferred from the positions of the wheels {names}")
        mirrored = tuple(each.joint for each in (*left, *right) if each.direction[1] < 0)
        if mirrored:
            self._notes.append(
                f"wheels with reversed axes, which turn backwards to drive forwards: {', '.join(mirrored)}"
            )
        return DriveTag(
            "differential",
            self._name,
            tuple(each.joint for each in left),
            tuple(each.joint for each in right),
            reversed_joints=mirrored,
        )

    def _mounts(self) -> set[str]:
        """Return the root and the links attached to it without a continuous joint: rockers, slides, but no swivels."""
        links = {self._robot.root}
        for _ in self._robot.joints:
            more = {
                each.child
                for each in self._robot.joints
                if each.parent in links and each.kind in ("fixed", "revolute", "prismatic") and not is_continuous(each)
            }
            if more <= links:
                break
            links |= more
        return links

    def _joint_speed(self, wheels: Iterable[Wheel]) -> float:
        """Return the lowest velocity limit of the wheels' joints [rad/s]; 0 without one."""
        limits = [self._joints[each.joint].limits.velocity for each in wheels]
        return min((each for each in limits if each), default=0.0)

    def _torque(self, drive: DriveTag, wheels: list[Wheel], radius: float) -> float:
        """Return the wheel torque [N m]: the tag's or the joints'; else twice the torque at which a wheel slips."""
        stated = drive.torque or min((self._joints[each.joint].limits.effort or 0.0 for each in wheels), default=0.0)
        return stated if stated > 0 else max(0.01, 2 * self._mass() * GRAVITY * radius / len(wheels))

    def _mass(self) -> float:
        return sum(max(0.0, each.inertia.mass) for each in self._robot.links if math.isfinite(each.inertia.mass))

    def _tipping(self) -> float:
        """Return half the acceleration [m/s2] that tips the robot over its contacts, forwards or backwards.

        a = g d / h with d the horizontal distance of the centre of mass from the contacts and h its height. At least
        0.1.
        """
        poses, total = link_poses(self._robot), self._mass()
        if not total > 0:
            return BRAKE
        centres = [(each.inertia.mass, (poses[each.name] @ each.inertia.centre).position) for each in self._robot.links]
        x, z = (sum(mass * place[axis] for mass, place in centres if mass > 0) / total for axis in (0, 2))
        stands = [(shape, pose) for shape, pose in self._placed if bottom(shape, pose) < self._floor + TOUCHES]
        places = [(pose @ shape.pose).position[0] for shape, pose in stands]
        height = z - self._floor
        if not places or not height > 0:
            return BRAKE
        room = min(max(places) - x, x - min(places))
        return max(0.1, 0.5 * GRAVITY * room / height)

    def _laser(self, laser: LaserConfig | None) -> LaserConfig | None:
        laser = self._sensor("laser", laser)
        if laser is None:
            return None
        # Rays start outside the sensor's own housing.
        own = self._shapes.get(laser.link, LinkShapes()).collisions
        inside = max(laser.clearance, circle_radius((each, laser.mount.pose.inverse()) for each in own) + 1e-3)
        return msgspec.structs.replace(laser, clearance=min(inside, laser.range_max / 2))

    def _sensor(self, kind: str, config: Any) -> Any:
        """Return the sensor if its link exists, with an existing frame."""
        if config is None:
            return None
        links = {each.name for each in self._robot.links}
        if config.link not in links:
            self._notes.append(f"{self._name}: the {kind} is on link {config.link!r}, which does not exist: left out")
            return None
        frame = config.mount.frame
        if frame and frame not in links:
            self._notes.append(
                f"{self._name}: the {kind}'s frame {frame!r} is not a link: its messages are in {config.link!r}"
            )
            config = msgspec.structs.replace(config, mount=msgspec.structs.replace(config.mount, frame=""))
        return config

    def _check_base_frame(self) -> None:
        stated = self._tags.base_frame
        if stated and stated != self._robot.root:
            self._notes.append(
                f"{self._name}: odometry is that of the root link {self._robot.root!r}, not of {stated!r} as in the "
                "tag: the tf tree has one root"
            )


def _mean(values: Iterable[float]) -> float:
    every = list(values)
    return sum(every) / len(every)


def _show(vector: Vector) -> str:
    return " ".join(f"{each:.2g}" for each in vector)
