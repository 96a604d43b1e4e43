"""The interface to a physics engine, ``World`` and ``BodyHandle``, and their records."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from messages.se3 import IDENTITY, Pose3, Rotation, Vector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

GRAVITY = 9.81
"""m/s2, toward -z."""
SOLVER_ITERATIONS = 50
"""Solver iterations per step; with 20 a robot drifts by 1.9 mm per metre driven, with 50 by 0.2."""
SLIDING_SHARE = 0.02
"""Share of its friction that a link has along its sliding axis. With 0.1, a square of four wheels turns 2.5 % short."""
MAX_PENETRATION = 0.002
"""m; allowed depth of a body in another or in the ground: that of resting on it, and rounding."""
MAX_SUNK = 0.1
"""m; allowed depth of a body's origin below the surface of a height map."""
MIN_STANDING_NORMAL = 0.7
"""Vertical part of a contact's normal above which standing on a ramp or height map is no collision: cos 45 degrees."""


def ground_samples(x: float, y: float, radius: float) -> Iterator[tuple[float, float]]:
    """Yield points [m] at which the ground around (x, y) is sampled: the centre, and two circles of 12 points."""
    yield x, y
    for reach in (radius / 2, radius):
        for step in range(12):
            turn = math.tau * step / 12
            yield x + reach * math.cos(turn), y + reach * math.sin(turn)


class Configuration(NamedTuple):
    """The pose of a body's root, and its joint positions, rad or m."""

    pose: Pose3
    joints: Mapping[str, float] = {}


class BodyState(NamedTuple):
    """The state of a body's root frame in world axes: position [m], orientation, velocity [m/s], turn rate [rad/s]."""

    position: Vector
    orientation: Rotation
    linear: Vector
    angular: Vector

    @classmethod
    def of_numbers(cls, numbers: Sequence[float]) -> BodyState:
        """Return the state of a row of ``World.states``, thirteen numbers."""
        x, y, z, i, j, k, w, vx, vy, vz, wx, wy, wz = numbers
        return cls((x, y, z), (i, j, k, w), (vx, vy, vz), (wx, wy, wz))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The thirteen numbers of a row of ``World.states``."""
        return *self.position, *self.orientation, *self.linear, *self.angular


class Inertia(NamedTuple):
    """A link's mass [kg], the pose of its centre of mass and principal axes in its frame, the moments [kg m2] about
    these, and its friction."""

    mass: float
    centre: Pose3
    moments: Vector
    friction: float


class JointReadings(NamedTuple):
    """The movable joints of a body in the order of ``BodyHandle.joints``: rad or m, rad/s or m/s, N m or N."""

    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]


class JointFriction(NamedTuple):
    """The friction of a joint: damping [N m s/rad or N s/m] and dry friction [N m or N]."""

    damping: float = 0.0
    friction: float = 0.0


class MotorTarget(NamedTuple):
    """A joint motor's target velocity [rad/s or m/s] and maximum effort [N m or N]."""

    velocity: float
    effort: float


class Contact(NamedTuple):
    """A contact between ``body``, a body of the world, and ``other``, another one or a static obstacle."""

    body: str
    other: str


@dataclass(frozen=True)
class Motor:
    """A joint driven to a target speed with at most ``torque`` [N m]; joints without a motor move freely."""

    joint: str
    torque: float


@dataclass(frozen=True)
class Body:
    """A body to spawn: a URDF with its root frame at ``pose``, at rest, and held there if ``fixed``.

    ``initial_positions`` are joint positions, 0 for joints not listed. Joints without a ``joint_friction`` have the
    URDF's damping and no dry friction. ``slides`` lists links, each with an axis of its frame along which it has
    ``SLIDING_SHARE`` of its friction.
    """

    name: str
    urdf: Path
    pose: Pose3 = IDENTITY
    motors: tuple[Motor, ...] = ()
    fixed: bool = False
    initial_positions: tuple[tuple[str, float], ...] = ()
    joint_friction: tuple[tuple[str, JointFriction], ...] = ()
    slides: tuple[tuple[str, Vector], ...] = ()


@dataclass(frozen=True)
class CameraModel:
    """A pinhole camera: image size in pixels, horizontal field of view [rad], clipping distances [m]."""

    width: int
    height: int
    fov: float
    near: float
    far: float


class BodyHandle(Protocol):
    """A body of the world, from its spawning to its deletion.

    Unknown names of joints and links raise ``services.runtime.errors.BadInput``.
    """

    @property
    def joints(self) -> tuple[str, ...]:
        """The movable joints, in the URDF's order."""

    @property
    def links(self) -> tuple[str, ...]:
        """The links, the root first."""

    @property
    def limited_damping(self) -> Mapping[str, float]:
        """Joints whose damping was reduced to the largest stable value, and its value."""

    @property
    def motor_joints(self) -> tuple[str, ...]:
        """The joints of the body's motors, in the order of ``set_speeds``."""

    def state(self) -> BodyState:
        """Return pose and velocity of the root frame; about 6 us."""

    def joint_readings(self) -> JointReadings:
        """Return positions, velocities and motor efforts of ``joints``."""

    def link_pose(self, link: str) -> Pose3:
        """Return the pose of a link's frame in the world."""

    def link_state(self, link: str) -> BodyState:
        """Return pose and velocity of a link's frame in the world; the velocity is that of its origin."""

    def inertia(self, link: str) -> Inertia:
        """Return mass and inertia of a link."""

    def set_speeds(self, speeds: Sequence[float]) -> None:
        """Set the target speeds [rad/s] of the motors, in their order; they hold until set again."""

    def set_torques(self, torques: Sequence[float]) -> None:
        """Apply these torques [N m] by the motors, in their order, for one step, instead of keeping a speed."""

    def set_efforts(self, efforts: Mapping[str, float]) -> None:
        """Apply efforts [N m or N] to joints for one step, without a limit; 4 us for one joint."""

    def drive_joints(self, targets: Mapping[str, MotorTarget]) -> None:
        """Make joints that have no motor keep velocities from now on, instead of having friction."""

    def release_joints(self, joints: Sequence[str]) -> None:
        """Let joints move freely again, against their friction only."""

    def joint_inertias(self) -> tuple[float, ...]:
        """Return the inertia [kg m2 or kg] moved by each of ``joints``, in the current configuration; 3 us."""

    def set_joint_friction(self, joint_friction: Mapping[str, JointFriction]) -> None:
        """Set the friction of joints from now on, also after a reset; other joints keep theirs."""

    def set_velocity(self, linear: Vector, angular: Vector) -> None:
        """Set the velocity of the root frame, m/s and rad/s in world axes; contacts and gravity then change it."""

    def apply_wrench(self, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        """Apply to a link, for one step, a force [N] at a world point [m] and a torque [N m], in world axes."""


class World(Protocol):
    """A world with level ground at z = 0 that advances in equal steps.

    The same calls in the same order give the same numbers, bit for bit. Unknown names, bodies that would overlap and
    URDFs that do not load raise ``services.runtime.errors.BadInput``.
    """

    @property
    def step_ns(self) -> int:
        """Simulation time of one step, ns."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all spawned bodies, in the order of their spawning."""

    @property
    def world_bodies(self) -> tuple[str, ...]:
        """Names of the world's own movable and moving bodies, in the order of its file."""

    def overlaps_at_start(self) -> tuple[str, ...]:
        """Return the movable bodies that the world's file places inside others; the first step throws them out."""

    def world_body_state(self, name: str) -> BodyState:
        """Return pose and velocity of one of ``world_bodies``."""

    def ground_height(self, x: float, y: float, radius: float) -> float:
        """Return the highest ground within ``radius`` of a point, m: of ramps, height maps and floors, or 0."""

    def body(self, name: str) -> BodyHandle:
        """Return the spawned body with this name."""

    def spawn(self, body: Body) -> BodyHandle:
        """Add a body; refused for a taken name, or an overlap with another body, an obstacle or the ground."""

    def delete(self, name: str) -> None:
        """Delete a body."""

    def reset(self) -> None:
        """Return all bodies to where they were spawned, or where the world's file has them, at rest, motors at zero.

        Handles stay valid.
        """

    def step(self) -> None:
        """Advance by ``step_ns``."""

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body, which keeps its joint positions, or a movable one of ``world_bodies``; refused on overlap."""

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Set joint positions, at rest; other joints keep theirs. Refused if the body would then overlap."""

    def states(self) -> NDArray[np.float64]:
        """Return the states of all bodies' root frames, in the order of ``names``; rows as in ``link_states``."""

    def joint_readings(self) -> NDArray[np.float64]:
        """Return the joints of all bodies, in the order of ``names`` and their ``joints``.

        Shape (3, n): rad or m, rad/s or m/s, N m or N.
        """

    def link_poses(self, links: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        """Return the poses of link frames in the world, each link given by the names of its body and itself.

        Shape (n, 7): position [m], orientation (x, y, z, w).
        """

    def link_states(self, links: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        """Return the states of link frames in the world, each link given by the names of its body and itself.

        Shape (n, 13): position [m], orientation (x, y, z, w), velocity [m/s] of the origin, turn rate [rad/s].
        """

    def contacts(self) -> tuple[Contact, ...]:
        """Return the pairs that touched in the last step, each once, sorted; the ground does not count."""

    def cast_rays(self, origins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cast rays from ``origins`` to ``ends`` [m], both of shape (n, 3).

        Return the distance to the first hit, shape (n,), as a fraction of each ray's length; inf without a hit.
        """

    def cast_fans(
        self, links: Sequence[tuple[str, str]], mount: Pose3, rays: NDArray[np.float64], near: float, far: float
    ) -> NDArray[np.float64]:
        """Cast the rays of identical sensors; return distances from them, m, shape (sensors, n), inf beyond ``far``.

        Args:
            links: The link of each sensor, by the names of its body and itself.
            mount: Pose of the sensor in its link.
            rays: Unit vectors in the sensor's frame, shape (n, 3).
            near: Start of the rays, m from the sensor; anything nearer is not hit.
            far: End of the rays, m from the sensor.
        """

    def render(self, eye: Pose3, camera: CameraModel) -> bytes:
        """Render the image from ``eye`` (z forward, x right, y down): rows from the top, three bytes RGB per pixel."""

    def close(self) -> None:
        """Release the engine's resources."""
