"""What the simulation asks of a physics engine: a few verbs over plain records, so that a second engine can follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
"""Of the solver in a step; with 20 a robot drifts by 1.9 mm per metre driven, with 50 by 0.2."""


SLIDING_SHARE = 0.02
"""Of a link's friction, along the axis that it slides along. With 0.1, a square of four wheels turns 2.5 % short."""


class Configuration(NamedTuple):
    """Where a body's root is and how its joints stand, rad or m."""

    pose: Pose3
    joints: Mapping[str, float] = {}


class BodyState(NamedTuple):
    """A body's root frame in the world: position [m], orientation, velocity [m/s] and turn rate [rad/s], all in world
    axes."""

    position: Vector
    orientation: Rotation
    linear: Vector
    angular: Vector

    @classmethod
    def of_numbers(cls, numbers: Sequence[float]) -> BodyState:
        """The state of the thirteen numbers of a row of ``World.states``."""
        x, y, z, i, j, k, w, vx, vy, vz, wx, wy, wz = numbers
        return cls((x, y, z), (i, j, k, w), (vx, vy, vz), (wx, wy, wz))

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its thirteen numbers, in this order."""
        return *self.position, *self.orientation, *self.linear, *self.angular


class Inertia(NamedTuple):
    """A link's mass [kg], where its centre of mass is in its own frame and how its principal axes lie, its moments
    [kg m2] about these, and its friction."""

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
    """What a joint resists its motion with: damping [N m s/rad or N s/m] and dry friction [N m or N]."""

    damping: float = 0.0
    friction: float = 0.0


class MotorTarget(NamedTuple):
    """What the motor of a joint keeps: a velocity [rad/s or m/s], with at most this effort [N m or N]."""

    velocity: float
    effort: float


class Contact(NamedTuple):
    """Two things that touch: ``body`` is a body of the world, ``other`` another one or a static obstacle."""

    body: str
    other: str


@dataclass(frozen=True)
class Motor:
    """A joint that is driven to a speed with at most ``torque`` [N m]; all other joints move freely."""

    joint: str
    torque: float


@dataclass(frozen=True)
class Body:
    """What enters the world: a URDF whose root frame is put at ``pose``, at rest, and held there if ``fixed``.

    ``initial_positions`` are those of joints, 0 where none is stated. Joints without a ``joint_friction`` have
    the URDF's damping and no friction. ``slides`` gives links, each with an axis of its frame along which it has
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
    """A pinhole camera: picture size in pixels, horizontal field of view [rad], clipping distances [m]."""

    width: int
    height: int
    fov: float
    near: float
    far: float


class BodyHandle(Protocol):
    """A body of the world, from its spawning to its deletion. Names of joints and links that do not exist raise
    ``services.runtime.errors.BadInput``."""

    @property
    def joints(self) -> tuple[str, ...]:
        """The movable joints, in the URDF's order."""

    @property
    def links(self) -> tuple[str, ...]:
        """The links, the root first."""

    @property
    def limited_damping(self) -> Mapping[str, float]:
        """Joints whose damping is less than what was asked for, since a step carries no more; and how much it is."""

    @property
    def motor_joints(self) -> tuple[str, ...]:
        """The joints of the body's motors, in the order of ``set_speeds``."""

    def state(self) -> BodyState:
        """Pose and velocity of the root frame; about 6 us."""

    def joint_readings(self) -> JointReadings:
        """Angles, speeds and motor torques of ``joints``."""

    def link_pose(self, link: str) -> Pose3:
        """Where the frame of a link is."""

    def link_state(self, link: str) -> BodyState:
        """Pose of a link's frame, and how its origin moves."""

    def inertia(self, link: str) -> Inertia:
        """Mass and inertia of a link."""

    def set_speeds(self, speeds: Sequence[float]) -> None:
        """Set the target speeds [rad/s] of the motors, in their order; they hold until set again."""

    def set_torques(self, torques: Sequence[float]) -> None:
        """Let the motors, in their order, give these torques [N m] for one step, instead of keeping a speed."""

    def set_efforts(self, efforts: Mapping[str, float]) -> None:
        """Put efforts [N m or N] on joints for one step, unlimited; 4 us for one joint."""

    def drive_joints(self, targets: Mapping[str, MotorTarget]) -> None:
        """Let joints without a motor of the body's keep velocities from now on, instead of their friction."""

    def release_joints(self, joints: Sequence[str]) -> None:
        """Let joints move freely again, against their friction alone."""

    def joint_inertias(self) -> tuple[float, ...]:
        """The inertia [kg m2 or kg] of all that moves with each of ``joints``, about it, as configured now; 3 us."""

    def set_joint_friction(self, joint_friction: Mapping[str, JointFriction]) -> None:
        """Set the friction of joints from now on, also after a reset; the others keep theirs."""

    def set_velocity(self, linear: Vector, angular: Vector) -> None:
        """Set how the root frame moves, m/s and rad/s in world axes, until contacts and gravity change it."""

    def apply_wrench(self, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        """Act on a link for one step: a force [N] at a point of the world [m] and a torque [N m], in world axes."""


class World(Protocol):
    """A world with a level ground at z = 0 that advances in equal steps.

    The same calls in the same order give the same numbers, bit for bit. Names that do not exist, bodies that would
    overlap and URDFs that do not load raise ``services.runtime.errors.BadInput``.
    """

    @property
    def step_ns(self) -> int:
        """Simulation time of one step, ns."""

    @property
    def names(self) -> tuple[str, ...]:
        """All bodies, in the order of their spawning."""

    @property
    def world_bodies(self) -> tuple[str, ...]:
        """The world's own bodies that are movable or moving, in the order of its file."""

    def overlaps_at_start(self) -> tuple[str, ...]:
        """Movable bodies that the world's file puts into something else: the first step throws them out."""

    def world_body_state(self, name: str) -> BodyState:
        """Pose and velocity of one of ``world_bodies``."""

    def ground_height(self, x: float, y: float, radius: float) -> float:
        """The highest ground within ``radius`` of a place, m: that of ramps, height maps and floors, or 0."""

    def body(self, name: str) -> BodyHandle:
        """The body of a name."""

    def spawn(self, body: Body) -> BodyHandle:
        """Add a body, unless its name is taken or it would overlap with another body, an obstacle or the ground."""

    def delete(self, name: str) -> None:
        """Remove a body."""

    def reset(self) -> None:
        """Start over: all present bodies as they were spawned, at rest, motors at zero, the world's as its file has
        them. Handles stay valid."""

    def step(self) -> None:
        """Advance by ``step_ns``."""

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body, whose joints keep their angles, or a movable one of ``world_bodies``. Refused where it would
        overlap."""

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Put joints at positions, at rest; the others stay as they are. Refused where the body would overlap then."""

    def states(self) -> NDArray[np.float64]:
        """How the root frames of all bodies move, in the order of ``names``; rows as those of ``link_states``."""

    def joint_readings(self) -> NDArray[np.float64]:
        """The joints of all bodies, in the order of ``names`` and of their ``joints``, shape (3, n): rad or m, rad/s or
        m/s, N m or N."""

    def link_poses(self, links: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        """Where the frames of links are, each given by its body and its own name, shape (n, 7): position [m],
        orientation (x, y, z, w)."""

    def link_states(self, links: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        """Where these are and how they move in the world, shape (n, 13): position [m], orientation (x, y, z, w),
        velocity [m/s] of the origin, turn rate [rad/s]."""

    def contacts(self) -> tuple[Contact, ...]:
        """The pairs that touched in the last step, each once, sorted; the ground does not count."""

    def cast_rays(self, origins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far rays get, shape (n,), as a fraction of their length, from ``origins`` to ``ends`` [m], shape (n, 3);
        inf where nothing is hit."""

    def cast_fans(
        self, links: Sequence[tuple[str, str]], mount: Pose3, rays: NDArray[np.float64], near: float, far: float
    ) -> NDArray[np.float64]:
        """How far the rays of equal sensors get, m, shape (sensors, n), from where these are; inf beyond ``far``.

        Args:
            links: The link of each sensor, by its body and its own name.
            mount: Where the sensor is in its link.
            rays: Directions in the sensor's frame, of length 1, shape (n, 3).
            near: Where the rays begin, m from the sensor: what is nearer is not met.
            far: Where they end, m.
        """

    def render(self, eye: Pose3, camera: CameraModel) -> bytes:
        """A picture from ``eye`` (z forward, x right, y down): rows from the top, three bytes RGB per pixel."""

    def close(self) -> None:
        """End the world."""
