"""The model of a robot that has a URDF and no ``model.toml``: from its tags and its geometry, with stated defaults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec

from messages.errors import unknown_name
from messages.se3 import Pose3, Vector, rotate, rotate_inverse
from models.dynamics import GRAVITY
from models.extents import bottom, circle_radius, lowest_point, placed_shapes, solid_shapes, support
from models.gazebo_tags import DriveTag, GazeboTags, step_rate
from models.model import LaserConfig, PlanarConfig, RobotModel, WheelConfig
from models.shapes import LinkShapes, Shape
from models.urdf import Joint, NoWheels, RobotDescription
from models.urdf_writer import link_poses

MAX_LINEAR = 1.0
"""m/s, of a base of which neither tag nor joint says how fast it is."""
MAX_ANGULAR = 3.0
"""rad/s, likewise."""
ACCELERATION = 1.0
"""m/s2, at most; half of what tips the robot where that is less."""
BRAKE = 2.0
"""m/s2, likewise."""
TOUCHES = 0.01
"""m; what is not higher above a robot's lowest point than this can touch the ground."""
MAX_PLAUSIBLE_SPEED = 10.0
"""m/s; a limit of a joint that comes to more means "none"."""

ENDLESS = 1000.0
"""rad; a revolute joint with a wider range than this counts as continuous."""

ROLL_DIRECTIONS = 24
"""In which a wheel is measured around its axle."""


@dataclass(frozen=True)
class Wheel:
    """A wheel: its joint, the link that has its shapes, the middle of its axle in that link's frame (``centre``) and
    in the root's (``place``) [m], the axle's unit vector in either (``axle``, ``direction``), radius and width [m], 0
    where no shape tells."""

    joint: str
    link: str
    centre: Vector
    place: Vector
    axle: Vector
    direction: Vector
    radius: float
    width: float


class InferredModel(NamedTuple):
    """A model, and remarks on what was chosen because nothing states it."""

    model: RobotModel
    notes: tuple[str, ...]


def infer_model(
    robot: RobotDescription, shapes: Mapping[str, LinkShapes], tags: GazeboTags, name: str
) -> InferredModel:
    """The model of a robot from its URDF alone; raises BadInput for a drive without its joints or its wheels.

    ``name`` is what remarks call the file.
    """
    return _Inference(robot, tags, shapes, name).result()


def read_wheel(robot: RobotDescription, shapes: Mapping[str, LinkShapes], joint: Joint) -> Wheel:
    """The wheel on a joint, as its shapes have it: the child, or the link that reaches farthest from the axle of those
    that fixed joints hold to it, as a tyre on a hub. What collides counts before what is only seen."""
    held = {joint.child: Pose3()}
    pending = [joint.child]
    for link in pending:
        for each in robot.joints:
            if each.parent == link and not each.single_dof:
                held[each.child] = held[link] @ each.transform()
                pending.append(each.child)
    solid = [link for link in held if link in shapes and shapes[link].collisions]
    wheels = [_wheel_of(robot, shapes, joint, link, held[link]) for link in solid or held]
    return max(wheels, key=lambda each: each.radius)


def _wheel_of(robot: RobotDescription, shapes: Mapping[str, LinkShapes], joint: Joint, link: str, held: Pose3) -> Wheel:
    """What the shapes of ``link`` are as a wheel; ``held`` is its pose in the frame of the joint's child."""
    solid = shapes.get(link, LinkShapes()).any
    flat = _across(joint.axis)
    reach = [_reach(solid, held, _combine(flat, math.tau * each / ROLL_DIRECTIONS)) for each in range(ROLL_DIRECTIONS)]
    out, back = _reach(solid, held, joint.axis), -_reach(solid, held, _scaled(joint.axis, -1.0))
    spheres = [each for each in solid if each.kind == "sphere"]
    centre = Pose3(_scaled(joint.axis, (out + back) / 2 if solid else 0.0))
    pose = link_poses(robot)[joint.child]
    return Wheel(
        joint=joint.name,
        link=link,
        centre=(held.inverse() @ centre).position,
        place=(pose @ centre).position,
        axle=rotate_inverse(held.orientation, joint.axis),
        direction=rotate(pose.orientation, joint.axis),
        radius=round(max(reach), 6) if solid else 0.0,  # angles in URDFs have few digits
        width=0.0 if len(spheres) == len(solid) else out - back,
    )


def turns_for_ever(joint: Joint) -> bool:
    """Whether a joint has no limit worth the name."""
    low, high = joint.limits.lower, joint.limits.upper
    endless = low is not None and high is not None and high - low > ENDLESS
    return joint.kind == "continuous" or (joint.kind == "revolute" and endless)


def rolling_joints(robot: RobotDescription) -> list[Joint]:
    """The continuous joints with a transverse axle: those of wheels, driven or not."""
    poses = link_poses(robot)
    return [
        joint
        for joint in robot.joints
        if turns_for_ever(joint) and abs(rotate(poses[joint.child].orientation, joint.axis)[2]) < 0.1
    ]


class _Inference:
    """The steps from tags and geometry to a model."""

    def __init__(self, robot: RobotDescription, tags: GazeboTags, shapes: Mapping[str, LinkShapes], name: str) -> None:
        self._robot, self._tags, self._shapes, self._name = robot, tags, solid_shapes(shapes), name
        self._joints = {each.name: each for each in robot.joints}
        self._notes: list[str] = []
        self._placed = placed_shapes(robot, shapes)
        self._floor = lowest_point(self._placed)

    def result(self) -> InferredModel:
        """The model of the robot."""
        tags, robot = self._tags, self._robot
        drive = tags.drive or self._guess_drive()
        drive_table: dict[str, Any] = {}
        wheels = planar = None
        fixed = tags.static or robot.root == "world"
        if drive is not None and drive.kind == "differential":
            wheels = self._wheels(drive, drive_table)
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
            odometry_rate=step_rate(min(rate, 50.0), 4),
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

    def _wheels(self, drive: DriveTag, table: dict[str, Any]) -> WheelConfig:
        sides = drive.left_joints, drive.right_joints
        left, right = ([self._wheel(name, drive.where) for name in side] for side in sides)
        if _mean(each.place[1] for each in left) < _mean(each.place[1] for each in right):
            left, right = right, left
            self._notes.append(f"{drive.where}: the left joints stand on the right: sides are exchanged")
        both = [*left, *right]
        radius = drive.radius or max(each.radius for each in both)
        if not radius > 0:
            raise NoWheels(f"{drive.where}: neither the tag nor a shape of the wheels tells their radius")
        track = _mean(each.place[1] for each in left) - _mean(each.place[1] for each in right)
        separation = drive.separation or track
        if not separation > 0:
            raise NoWheels(f"{drive.where}: the wheels do not stand left and right of the robot's x axis")
        for each in both:
            if each.direction[1] < 0.5:
                self._notes.append(
                    f"{drive.where}: joint {each.joint!r} turns about {_show(each.direction)} and not about the "
                    "robot's y axis: forwards is not where x points"
                )
        if len(both) > 2:
            # Here a base that skids turns as its track says; figures for Gazebo and for real ones are often larger.
            factor = track / separation
            if abs(factor - 1) > 0.02:
                table["wheel_separation_multiplier"] = round(min(max(factor, 0.1), 10.0), 4)
                self._notes.append(
                    f"{drive.where}: wheelSeparation {separation:.4g} m is times {factor:.4g} here: a base that skids "
                    f"turns by its track of {track:.4g} m"
                )
        fastest = drive.max_linear or self._joint_speed(both) * radius
        if not 0 < fastest <= MAX_PLAUSIBLE_SPEED:
            fastest = MAX_LINEAR
        least = self._tipping()
        rise = drive.acceleration or 0.0
        if rise > max(ACCELERATION, least):
            self._notes.append(
                f"{drive.where}: the acceleration of {rise:g} m/s2 is {max(ACCELERATION, least):.3g} m/s2 here: more "
                "than half of what tips it, it slips"
            )
            rise = max(ACCELERATION, least)
        effective = separation * table.get("wheel_separation_multiplier", 1.0)
        return WheelConfig(
            left_joint=left[0].joint,
            right_joint=right[0].joint,
            other_left=tuple(each.joint for each in left[1:]),
            other_right=tuple(each.joint for each in right[1:]),
            separation=separation,
            radius=radius,
            max_linear=fastest,
            max_angular=drive.max_angular or min(MAX_ANGULAR, 2 * fastest / effective),
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
        """The wheels of a robot whose tags name no drive: pairs that hang on the root, of one radius,
        left and right of it, on the ground; of those that transmissions move with a velocity, where there are any."""
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
            and each.direction[1] > 0.9
            and each.place[2] - each.radius < self._floor + 2 * TOUCHES
            and abs(each.place[1]) > each.radius / 10
        ]
        left = sorted((each for each in wheels if each.place[1] > 0), key=lambda each: -each.place[0])
        right = sorted((each for each in wheels if each.place[1] < 0), key=lambda each: -each.place[0])
        if not left or len(left) != len(right) or len(left) > 4:
            return None
        for one, other in zip(left, right, strict=True):
            mirrored = abs(one.place[0] - other.place[0]) + abs(one.place[1] + other.place[1])
            if mirrored > 0.02 or abs(one.radius - other.radius) > 0.1 * one.radius:
                return None
        names = ", ".join(each.joint for each in (*left, *right))
        self._notes.append(f"no tag names a drive: driven by its wheels {names}, as they stand")
        return DriveTag(
            "differential", self._name, tuple(each.joint for each in left), tuple(each.joint for each in right)
        )

    def _mounts(self) -> set[str]:
        """The root and the links attached to it without a continuous joint: a rocker counts, a swivel does not."""
        links = {self._robot.root}
        for _ in self._robot.joints:
            more = {
                each.child
                for each in self._robot.joints
                if each.parent in links and each.kind in ("fixed", "revolute") and not turns_for_ever(each)
            }
            if more <= links:
                break
            links |= more
        return links

    def _joint_speed(self, wheels: Iterable[Wheel]) -> float:
        """The lowest velocity limit of the wheels' joints, rad/s; 0 without one."""
        limits = [self._joints[each.joint].limits.velocity for each in wheels]
        return min((each for each in limits if each), default=0.0)

    def _torque(self, drive: DriveTag, wheels: list[Wheel], radius: float) -> float:
        """That of the tag, or of the joints; else twice what makes a wheel slip."""
        stated = drive.torque or min((self._joints[each.joint].limits.effort or 0.0 for each in wheels), default=0.0)
        return stated if stated > 0 else max(0.01, 2 * self._mass() * GRAVITY * radius / len(wheels))

    def _mass(self) -> float:
        return sum(max(0.0, each.inertia.mass) for each in self._robot.links if math.isfinite(each.inertia.mass))

    def _tipping(self) -> float:
        """Half the acceleration [m/s2] that tips the robot over what it stands on, forwards or backwards.

        a = g d / h with d the distance from the centre of mass to where it stands and h its height. At least 0.1.
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
        # Rays begin outside the sensor's own housing.
        own = self._shapes.get(laser.link, LinkShapes()).collisions
        inside = max(laser.clearance, circle_radius((each, laser.mount.pose.inverse()) for each in own) + 1e-3)
        return msgspec.structs.replace(laser, clearance=min(inside, laser.range_max / 2))

    def _sensor(self, kind: str, config: Any) -> Any:
        """The sensor, if its link is there, with a frame that is."""
        if config is None:
            return None
        links = {each.name for each in self._robot.links}
        if config.link not in links:
            self._notes.append(f"{self._name}: the {kind} sits on link {config.link!r}, which does not exist: left out")
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
                f"{self._name}: odometry is that of the root {self._robot.root!r}, the tag says {stated!r}: the tree "
                "of frames has one root"
            )


def _reach(shapes: Iterable[Shape], frame: Pose3, direction: Vector) -> float:
    return max((support(each, frame, direction) for each in shapes), default=0.0)


def _across(axis: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors at right angles to a unit vector and to each other."""
    least = min(range(3), key=lambda each: abs(axis[each]))
    other = [0.0, 0.0, 0.0]
    other[least] = 1.0
    one = _cross(axis, (other[0], other[1], other[2]))
    length = math.sqrt(sum(each * each for each in one))
    one = _scaled(one, 1 / length)
    return one, _cross(axis, one)


def _combine(plane: tuple[Vector, Vector], angle: float) -> Vector:
    (a, b, c), (d, e, f) = plane
    cos, sin = math.cos(angle), math.sin(angle)
    return a * cos + d * sin, b * cos + e * sin, c * cos + f * sin


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _scaled(vector: Vector, factor: float) -> Vector:
    return vector[0] * factor, vector[1] * factor, vector[2] * factor


def _mean(values: Iterable[float]) -> float:
    every = list(values)
    return sum(every) / len(every)


def _show(vector: Vector) -> str:
    return " ".join(f"{each:.2g}" for each in vector)
