"""The world in MuJoCo, whose state is in arrays that the bodies share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from math import inf
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, Vector, add_cross, rotate, rotate_inverse, rotated_axes
from models.world import WorldBody, WorldDescription
from services.runtime.errors import BadInput, unknown_name
from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_body import ROOT_POSITIONS, ROOT_VELOCITIES, MujocoBody, orientation_of
from services.sim.physics.mujoco_camera import MujocoCamera
from services.sim.physics.mujoco_overlaps import OverlapChecker
from services.sim.physics.mujoco_rays import RayModel, own_hits
from services.sim.physics.mujoco_robot import read_tree
from services.sim.physics.mujoco_scene import SEEN_GROUPS, PlacedRobot, Scene, build_scene, movable_bodies, wxyz
from services.sim.physics.world import (
    MIN_STANDING_NORMAL,
    SLIDING_SHARE,
    Body,
    BodyState,
    CameraModel,
    Configuration,
    Contact,
    ground_samples,
)

SECOND = 1_000_000_000
Floats = NDArray[np.float64]

_SKY = 1e4
"""m; nothing is farther away."""
_SMOOTH = 0.1
"""Friction up to which a contact is assumed to keep sliding through a step, as a caster's does."""
_LIFT = 0.002
"""m/s; a contact that sliding lifts by less is not solved again."""
_MIN_FRICTION: float = mujoco.mjMINMU
"""Without any friction, the engine lets a contact give way, and a body standing on it sinks into the ground."""


class _Sliding(NamedTuple):
    """Contacts by their rows among the constraints, shape (n,): their friction along both tangents, shape (n, 2), and
    the normal acceleration [m/s2] that they require without sliding."""

    rows: NDArray[np.int32]
    friction: Floats
    motion: Floats


class _LinkPlan(NamedTuple):
    """How to read the poses of links: their poses in their parts (of arrays); which of them are on a root part
    (``at_root``), with the rows of those bodies; and the part numbers of the others."""

    places: Pose3
    at_root: NDArray[np.bool_]
    roots: NDArray[np.intp]
    parts: NDArray[np.intp]


class MujocoWorld:
    """Implements ``World``. Opened by ``with``; bodies, obstacles and ground come from ``description``.

    The model is compiled only when it is needed and out of date: a hundred robots are spawned as fast as one. Bodies
    are kept in the order of their spawning, which is that of the engine's arrays.
    """

    def __init__(self, description: WorldDescription, step_ns: int) -> None:
        self.description, self._step_ns = description, step_ns
        self._bodies: dict[str, MujocoBody] = {}

    def __enter__(self) -> Self:
        self._bodies.clear()
        self._world_bodies = {body.name: MujocoWorldBody(self, body) for body in movable_bodies(self.description)}
        self._moving = [each for each in self._world_bodies.values() if each.body.kind == "moving"]
        self._obstacles = {body.name for body in self.description.all_bodies}
        self._checker = OverlapChecker(self.description)
        self._scene: Scene | None = None
        self._rays: RayModel | None = None
        self._camera: MujocoCamera | None = None
        self._steps, self._pushed, self._fresh = 0, False, False
        self._velocity = np.zeros(6)
        self._touching: tuple[Contact, ...] | None = ()
        # Compile now, so that errors in the world are reported before anything is spawned.
        self._current()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def step_ns(self) -> int:
        """Simulation time of one step, ns."""
        return self._step_ns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all spawned bodies, in the order of their spawning."""
        return tuple(self._bodies)

    def body(self, name: str) -> MujocoBody:
        if (body := self._bodies.get(name)) is None:
            raise unknown_name("body", name, self._bodies)
        return body

    @property
    def world_bodies(self) -> tuple[str, ...]:
        """Names of the world's movable and moving bodies."""
        return tuple(self._world_bodies)

    def world_body_state(self, name: str) -> BodyState:
        return self._world_body(name).state()

    def overlaps_at_start(self) -> tuple[str, ...]:
        """Return the movable bodies that the world's file places inside others; the first step throws them out."""
        found = []
        for name, each in self._world_bodies.items():
            if each.body.kind == "movable":
                try:
                    self._checker.check_world_body(name, each.body.pose, {}, {})
                except BadInput as error:
                    found.append(str(error))
        return tuple(found)

    def ground_height(self, x: float, y: float, radius: float) -> float:
        """Return the highest ground within ``radius`` of a point, m: of ramps, height maps and floors, or 0."""
        highest = 0.0
        if self._checker.has_grounds:
            for point in ground_samples(x, y, radius):
                highest = max(highest, self._checker.ground_height(*point, self._places()) or 0.0)
        return highest

    def spawn(self, body: Body) -> MujocoBody:
        """Add a body; raises BadInput for a taken name, an overlap, or a URDF that lacks a motor's joint."""
        if body.name in self._bodies:
            raise BadInput(f"a body named {body.name!r} is already in the world; delete it first")
        if body.name in self._obstacles:
            raise BadInput(f"{body.name!r} is an obstacle of this world; take another name")
        added = MujocoBody(self, body, read_tree(body.urdf))
        self._checker.check(added.placed, added.configuration, self._others(body.name), self._places())
        self._bodies[body.name] = added
        self._change_bodies()
        return added

    def delete(self, name: str) -> None:
        """Delete a body."""
        self.body(name)
        self._change_bodies()
        del self._bodies[name]
        self._touching = tuple(each for each in self.contacts() if name not in each)

    def reset(self) -> None:
        """Return everything to its initial state, and clear the solver's: bit for bit a fresh start."""
        self._current()
        mujoco.mj_resetData(self._model, self._data)
        self._touching, self._steps = (), 0
        for each in self._world_bodies.values():
            each.start()
        for body in self._bodies.values():
            body.start()
        self.positions_changed()

    def step(self) -> None:
        """Advance by ``step_ns``, in the stages of ``mj_step``.

        In between, each contact's friction is set to the product of that of both sides, and the motors' speeds are
        applied.
        """
        self._current()
        model, data, seconds = self._model, self._data, self._step_ns / SECOND
        for each in self._moving:
            each.follow_path(self._steps * seconds, seconds)
            self._fresh = False
        self._steps += 1
        self.refresh()
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            self._set_contact_friction()
        mujoco.mj_makeConstraint(model, data)
        mujoco.mj_island(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        driven = np.flatnonzero(model.dof_frictionloss)
        data.efc_aref[: len(driven)] += data.efc_KBIP[: len(driven), 1] * self._targets[driven]
        sliding = self._set_contact_motion() if data.ncon else None
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        if sliding is not None:
            self._solve_again(sliding)
        mujoco.mj_implicit(model, data)
        self._motor_efforts[:] = 0.0
        self._motor_efforts[driven] = data.efc_force[: len(driven)]
        data.qfrc_applied[:] = 0.0
        if self._pushed:
            data.xfrc_applied[:] = 0.0
            self._pushed = False
        self._fresh, self._touching = False, None

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body, or a movable one of the world; raises BadInput if it would overlap."""
        pose = Pose3(state.position, state.orientation)
        if name in self._world_bodies:
            self._set_world_body_state(name, state)
            return
        body = self.body(name)
        self._check(body, Configuration(pose, body.configuration.joints))
        body.place(pose)
        body.set_velocity(state.linear, state.angular)

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Set joint positions, at rest; raises BadInput if the body would then overlap."""
        body = self.body(name)
        pose, joints = body.configuration
        for joint in positions:
            body.rate_index(joint)
        self._check(body, Configuration(pose, {**joints, **positions}))
        body.set_joints(positions)

    def states(self) -> Floats:
        self._current()
        if not self._free_in_order:
            return np.array([body.state().numbers for body in self._bodies.values()]).reshape(-1, 13)
        place: Any = self._data.qpos[self._root_positions].T
        rates: Any = self._data.qvel[self._root_rates].T
        orientation = place[[4, 5, 6, 3]]
        angular = rotate(orientation, rates[3:])  # in the axes of the root
        return np.concatenate((place[:3], orientation, rates[:3], angular)).T

    def joint_readings(self) -> Floats:
        self._current()
        rates = self._joint_rates
        return np.array((self._data.qpos[self._joint_positions], self._data.qvel[rates], self._motor_efforts[rates]))

    def link_poses(self, links: Sequence[tuple[str, str]]) -> Floats:
        plan = self._plan(links)
        return np.concatenate(self._frames(plan) @ plan.places).T

    def contacts(self) -> tuple[Contact, ...]:
        """Return the pairs that touched in the last step; standing on a ramp, for example, does not count."""
        if self._touching is None:
            self._touching = self._find_contacts()
        return self._touching

    def cast_rays(self, origins: Floats, ends: Floats) -> Floats:
        """Cast rays; return the distance to the first hit as a fraction of each ray's length, inf without a hit.

        Consecutive rays with the same origin are cast together.
        """
        self.refresh()
        vectors = ends - origins
        fractions = np.empty(len(origins))
        starts = np.flatnonzero(np.any(origins[1:] != origins[:-1], axis=1)) + 1
        hit, distance = np.empty(len(origins), np.int32), np.empty(len(origins))
        for at, end in zip([0, *starts.tolist()], [*starts.tolist(), len(origins)], strict=True):
            count = end - at
            self._cast_together(origins[at], vectors[at:end], hit[:count], distance[:count])
            fractions[at:end] = distance[:count]
        fractions[(fractions < 0) | (fractions > 1)] = inf
        return fractions

    def cast_fans(
        self, links: Sequence[tuple[str, str]], mount: Pose3, rays: Floats, near: float, far: float
    ) -> Floats:
        """Cast the rays of identical sensors, all of one together: a third of the time of as many single rays.

        The part that carries the sensor is excluded: where rays hit it never changes, and is known.
        """
        self.refresh()
        seen = self._seen_by_rays()
        found, hit = np.empty((len(links), len(rays))), np.empty(len(rays), np.int32)
        places: Any = self.link_poses(links).T
        eyes = Pose3(places[:3], places[3:]) @ mount
        origins, axes = np.ascontiguousarray(np.transpose(eyes.position)), rotated_axes(eyes.orientation)
        turns = np.moveaxis(np.array(axes), 2, 0)
        near_bodies = seen.near(self._data, origins, far)
        for row, (name, link), turn, origin, bodies in zip(found, links, turns, origins, near_bodies, strict=True):
            body = self.body(name)
            directions = rays @ turn
            carrier = self._first_parts[name] + body.link_place(link)[0]
            seen.keep(bodies)
            self._cast_together(origin, directions, hit, row, carrier, far)
            for ray in np.flatnonzero((row >= 0) & (row < near)).tolist():
                start = origin + near * directions[ray]
                row[ray] = self._cast_on(start, directions[ray], carrier, near)
            row[(row < 0) | (row > far)] = inf
            np.minimum(row, own_hits(body.tree, link, mount, rays, near, far), out=row)
        seen.keep_all()
        return found

    def _seen_by_rays(self) -> RayModel:
        if self._rays is None:
            self._rays = RayModel(self._model)
        return self._rays

    def _cast_on(self, start: Floats, direction: Floats, carrier: int, near: float) -> float:
        hit = np.zeros(1, np.int32)
        distance: float = mujoco.mj_ray(self._model, self._data, start, direction, SEEN_GROUPS, 1, carrier, hit)
        return near + distance if distance >= 0 else inf

    def render(self, eye: Pose3, camera: CameraModel) -> bytes:
        """Render an image by OpenGL; raises BadInput if there is no library for it."""
        self.refresh()
        if self._camera is None:
            self._camera = MujocoCamera(self.description, tuple(body.placed for body in self._bodies.values()))
        return self._camera.render(self._data, eye, camera)

    def close(self) -> None:
        """Release the models and OpenGL."""
        self._checker.close()
        self._close_camera()

    def positions_changed(self) -> None:
        """Mark derived positions as out of date, after positions were set."""
        self._fresh = False

    def refresh(self) -> None:
        """Update the poses of all parts."""
        self._current()
        if self._fresh:
            return
        for index, body in enumerate(self._held):
            self._data.mocap_pos[index] = body.arrays.base[:3]
            self._data.mocap_quat[index] = body.arrays.base[3:]
        mujoco.mj_kinematics(self._model, self._data)
        self._fresh = True

    def part_pose(self, body: str, part: int) -> Pose3:
        """Return the pose of a part's frame in the world."""
        self.refresh()
        number = self._first_parts[body] + part
        x, y, z = self._data.xpos[number].tolist()
        return Pose3((x, y, z), orientation_of(self._data.xquat[number].tolist()))

    def part_state(self, body: str, part: int) -> BodyState:
        """Return pose and velocity of a part's frame in the world."""
        pose = self.part_pose(body, part)
        self._compute_velocities()
        wx, wy, wz, vx, vy, vz = self._part_velocity(self._first_parts[body] + part)
        return BodyState(*pose, (vx, vy, vz), (wx, wy, wz))

    def link_states(self, links: Sequence[tuple[str, str]]) -> Floats:
        plan, data = self._plan(links), self._data
        self.refresh()
        self._compute_velocities()
        frames = self._frames(plan)
        moves: Any = np.empty((6, len(links)))
        moves[:, plan.at_root] = self.states()[plan.roots, 7:].T
        # As mj_objectVelocity computes it: the engine keeps the velocity of the whole body's centre of mass.
        parts, trees = plan.parts, self._model.body_rootid[plan.parts]
        a, b, c = (data.xpos[parts] - data.subtree_com[trees]).T
        i, j, k, u, v, w = data.cvel[parts].T
        moves[:, ~plan.at_root] = u - (b * k - c * j), v - (c * i - a * k), w - (a * j - b * i), i, j, k
        vx, vy, vz, wx, wy, wz = moves
        moved = add_cross((vx, vy, vz), (wx, wy, wz), rotate(frames.orientation, plan.places.position))
        return np.concatenate((*(frames @ plan.places), moved, moves[3:])).T

    def _plan(self, links: Sequence[tuple[str, str]]) -> _LinkPlan:
        self._current()
        if (plan := self._plans.get(links := tuple(links))) is None:
            rows = {name: row for row, name in enumerate(self.names)}
            found = [(name, *self.body(name).link_place(link)) for name, link in links]
            places: Any = np.array([(*place.position, *place.orientation) for _, _, place in found]).reshape(-1, 7).T
            plan = self._plans[links] = _LinkPlan(
                Pose3(places[:3], places[3:]),
                np.array([part == 0 for _, part, _ in found], bool),
                np.array([rows[name] for name, part, _ in found if part == 0], np.intp),
                np.array([self._first_parts[name] + part for name, part, _ in found if part], np.intp),
            )
        return plan

    def _frames(self, plan: _LinkPlan) -> Pose3:
        """Return the poses of the links' parts, of arrays."""
        frames: Any = np.empty((7, len(plan.at_root)))
        if len(plan.roots):
            frames[:, plan.at_root] = self._root_frames(plan.roots)
        if len(plan.parts):
            self.refresh()
            frames[:3, ~plan.at_root] = self._data.xpos[plan.parts].T
            frames[3:, ~plan.at_root] = self._data.xquat[plan.parts].T[[1, 2, 3, 0]]
        return Pose3(frames[:3], frames[3:])

    def _root_frames(self, rows: NDArray[np.intp]) -> Floats:
        """Return the poses of bodies' roots, shape (7, n)."""
        if not self._free_in_order:
            return self.states()[rows, :7].T
        frames: Floats = self._data.qpos[self._root_positions[rows]].T[[0, 1, 2, 4, 5, 6, 3]]
        return frames

    def _compute_velocities(self) -> None:
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)

    def _part_velocity(self, number: int) -> tuple[float, ...]:
        """Return turn rate and velocity of a part's frame."""
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_XBODY, number, self._velocity, 0)
        return tuple(self._velocity.tolist())

    def joint_inertias(self, body: str) -> Floats:
        """Return the inertia about each rate of a body, the root's six first unless it is fixed."""
        self.refresh()
        model, data = self._model, self._data
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        found: Floats = data.M[model.M_rowadr + model.M_rownnz - 1][self._rates[body]]
        return found

    def push(self, body: str, part: int, force: Vector, torque: Vector, point: Vector) -> None:
        """Apply a wrench to a part in the next step."""
        self.refresh()
        number = self._first_parts[body] + part
        mujoco.mj_comPos(self._model, self._data)
        x, y, z = (a - b for a, b in zip(point, self._data.xipos[number].tolist(), strict=True))
        about = add_cross(torque, (x, y, z), force)
        self._data.xfrc_applied[number] += (*force, *about)
        self._pushed = True

    def _world_body(self, name: str) -> MujocoWorldBody:
        if (handle := self._world_bodies.get(name)) is None:
            raise unknown_name("movable body", name, self._world_bodies)
        return handle

    def _set_world_body_state(self, name: str, state: BodyState) -> None:
        handle = self._world_bodies[name]
        if handle.body.kind == "moving":
            raise BadInput(f"{name!r} follows its path: nothing else moves it")
        places = {other: pose for other, pose in self._places().items() if other != name}
        pose = Pose3(state.position, state.orientation)
        self._checker.check_world_body(name, pose, self._others(name), places)
        handle.set_state(state)

    def _check(self, body: MujocoBody, configuration: Configuration) -> None:
        self._checker.check(body.placed, configuration, self._others(body.description.name), self._places())

    def _others(self, name: str) -> dict[str, tuple[PlacedRobot, Configuration]]:
        return {other: (body.placed, body.configuration) for other, body in self._bodies.items() if other != name}

    def _places(self) -> dict[str, Pose3]:
        """Return the poses of the world's movable and moving bodies."""
        return {name: each.pose for name, each in self._world_bodies.items()}

    def _change_bodies(self) -> None:
        """Mark the model as out of date; the contacts of the last step are read before it is gone."""
        self._touching = self.contacts()
        self._scene = None
        self._close_camera()

    def _close_camera(self) -> None:
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def _current(self) -> None:
        """Compile the model if it is out of date."""
        if self._scene is None:
            self._compile()

    def _compile(self) -> None:
        """Compile the model; every body keeps its state."""
        placed = [body.placed for body in self._bodies.values()]
        scene = self._scene = build_scene(self.description, placed, self._step_ns / SECOND)
        model = self._model = scene.model
        self._rays = None
        data = self._data = mujoco.MjData(model)
        self._targets, self._motor_efforts = np.zeros(model.nv), np.zeros(model.nv)
        self._plans: dict[tuple[tuple[str, str], ...], _LinkPlan] = {}
        self._first_parts: dict[str, int] = {}
        self._rates: dict[str, slice] = {}
        position = rate = 0
        for each in self._world_bodies.values():
            count, rates = len(each.positions), len(each.velocities)
            each.bind(data.qpos[position : position + count], data.qvel[rate : rate + rates])
            position, rate = position + count, rate + rates
        part = 1 + len(self.description.all_bodies)
        roots, root_rates, joints, joint_rates = [], [], [], []
        for name, body in self._bodies.items():
            arrays, at = body.arrays, slice(rate, rate + len(body.arrays.velocities))
            arrays.positions = _moved(arrays.positions, data.qpos[position : position + len(arrays.positions)])
            arrays.velocities = _moved(arrays.velocities, data.qvel[at])
            arrays.warmstart = _moved(arrays.warmstart, data.qacc_warmstart[at])
            arrays.targets = _moved(arrays.targets, self._targets[at])
            arrays.limits = _moved(arrays.limits, model.dof_frictionloss[at])
            arrays.damping = _moved(arrays.damping, model.dof_damping[at])
            arrays.applied = _moved(arrays.applied, data.qfrc_applied[at])
            arrays.motor_efforts = _moved(arrays.motor_efforts, self._motor_efforts[at])
            self._first_parts[name], self._rates[name] = part, at
            roots.append(position + np.arange(ROOT_POSITIONS))
            root_rates.append(rate + np.arange(ROOT_VELOCITIES))
            joints.append(position + body.joint_positions)
            joint_rates.append(rate + body.joint_rates)
            position, rate = position + len(arrays.positions), rate + len(arrays.velocities)
            part += len(body.tree.parts)
        self._held = [body for body in self._bodies.values() if body.fixed]
        self._free_in_order = bool(self._bodies) and not self._held
        self._root_positions, self._root_rates = np.array(roots, np.intp), np.array(root_rates, np.intp)
        none: list[NDArray[np.intp]] = [np.zeros(0, np.intp)]
        self._joint_positions, self._joint_rates = np.concatenate(joints or none), np.concatenate(joint_rates or none)
        self._fresh = False

    def _set_contact_friction(self) -> None:
        """Set each contact's friction to the product of both sides', alike in all directions unless a link slides."""
        scene, contact = self._scene, self._data.contact
        assert scene is not None
        pairs = contact.geom
        product = np.maximum(scene.friction[pairs[:, 0]] * scene.friction[pairs[:, 1]], _MIN_FRICTION)
        contact.friction[:, :2] = product[:, None]
        if scene.slides:
            for side in (0, 1):
                axes = scene.slide[pairs[:, side]]
                for index in np.flatnonzero(axes.any(axis=1)).tolist():
                    self._let_slide(index, int(pairs[index, side]), axes[index], float(product[index]))

    def _let_slide(self, index: int, shape: int, axis: Floats, friction: float) -> None:
        """Turn the frame of a contact so that its second tangent is along an axis of the part of ``shape``."""
        contact = self._data.contact
        along = self._data.xmat[self._model.geom_bodyid[shape]].reshape(3, 3) @ axis
        frame = contact.frame[index]
        normal = frame[:3]
        along = along - (along @ normal) * normal
        length = math.sqrt(along @ along)
        if length > 0.1:
            along /= length
            frame[3:6], frame[6:9] = np.cross(along, normal), along
            contact.friction[index, :2] = friction, SLIDING_SHARE * friction

    def _set_contact_motion(self) -> _Sliding | None:
        """Set the normal accelerations of contacts; return those whose sliding has to be checked after solving.

        Contacts with depth lose a quarter of it and all of their approach speed; those still apart may close their gap.
        The engine's friction is the convex model, in which a contact that slides with v lifts by mu v. That is
        subtracted, since otherwise casters hop and a burger drives 1 % short. Whether a contact with much friction
        keeps sliding is known only after the step is solved.
        """
        data, seconds = self._data, self._step_ns / SECOND
        contact = data.contact
        rows, friction, distance = contact.efc_address, contact.friction, contact.dist
        if rows.min() < 0:
            kept = np.flatnonzero(rows >= 0)
            rows, friction, distance = rows[kept], friction[kept], distance[kept]
        speed, gains = data.efc_vel, data.efc_KBIP
        lift = np.hypot(friction[:, 0] * speed[rows + 1], friction[:, 1] * speed[rows + 2])
        stiffness = np.where(distance > 0, gains[rows, 1] / seconds, gains[rows, 0])
        motion = -gains[rows, 1] * speed[rows] - stiffness * distance
        data.efc_aref[rows] = motion - gains[rows + 1, 1] * lift
        rough = (lift > _LIFT) & (friction[:, 0] > _SMOOTH)
        return _Sliding(rows[rough], friction[rough], motion[rough]) if rough.any() else None

    def _solve_again(self, sliding: _Sliding) -> None:
        """Solve the step again, for the sliding found in the first solution."""
        data = self._data
        left = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(self._model, data, left, data.qacc)
        left -= data.efc_aref
        rows, friction, motion = sliding
        lift = np.hypot(friction[:, 0] * left[rows + 1], friction[:, 1] * left[rows + 2])
        required = motion - lift
        stopped = required - data.efc_aref[rows] > _LIFT / (self._step_ns / SECOND)
        if stopped.any():
            data.efc_aref[rows[stopped]] = required[stopped]
            mujoco.mj_fwdConstraint(self._model, data)

    def _find_contacts(self) -> tuple[Contact, ...]:
        scene, data = self._scene, self._data
        if scene is None or not data.ncon:
            return ()
        pairs = data.contact.geom
        owners = scene.owner[pairs]
        counts = (owners[:, 0] >= 0) & (owners[:, 1] >= 0) & (owners[:, 0] != owners[:, 1])
        counts &= ~(scene.ground[pairs].any(axis=1) & (np.abs(data.contact.frame[:, 2]) > MIN_STANDING_NORMAL))
        # Near misses are also listed; a contact has depth or transmits a force.
        rows = data.contact.efc_address
        counts &= (data.contact.dist <= 0) | ((rows >= 0) & (data.efc_force[np.maximum(rows, 0)] > 0))
        found = set()
        for one, other in owners[counts].tolist():
            first, second = sorted((scene.owners[one], scene.owners[other]))
            if first in self._bodies:
                found.add(Contact(first, second))
            elif second in self._bodies:
                found.add(Contact(second, first))
        return tuple(sorted(found))

    def _cast_together(
        self,
        origin: Floats,
        vectors: Floats,
        hit: NDArray[np.int32],
        distance: Floats,
        exclude: int = -1,
        far: float = _SKY,
    ) -> None:
        """Cast rays from one origin; write their distances, in lengths of ``vectors``, -1 without a hit."""
        model, data, count = self._seen_by_rays().model, self._data, len(vectors)
        if count == 1:
            distance[0] = mujoco.mj_ray(model, data, origin, vectors[0], SEEN_GROUPS, 1, exclude, hit[:1])
            return
        flat = np.ascontiguousarray(vectors).ravel()
        mujoco.mj_multiRay(model, data, origin, flat, SEEN_GROUPS, 1, exclude, hit, distance, None, count, far)


class MujocoWorldBody:
    """A movable or moving body of the world."""

    def __init__(self, world: MujocoWorld, body: WorldBody) -> None:
        self.body, self._world = body, world
        movable = body.kind == "movable"
        self.positions, self.velocities = np.zeros(7 if movable else 3), np.zeros(6 if movable else 3)
        self.start()

    def start(self) -> None:
        """Return it to its pose in the world's file, at rest."""
        self.velocities[:] = 0.0
        if self.body.path is not None:
            self.positions[:] = 0.0
        else:
            self.place(self.body.pose)

    def bind(self, positions: Floats, velocities: Floats) -> None:
        """Move its state into the arrays of a new model."""
        self.positions, self.velocities = _moved(self.positions, positions), _moved(self.velocities, velocities)

    @property
    def pose(self) -> Pose3:
        """Its pose in the world."""
        if self.body.path is not None:
            x, y, z = (a + b for a, b in zip(self.body.pose.position, self.positions.tolist(), strict=True))
            return Pose3((x, y, z), self.body.pose.orientation)
        x, y, z, *quaternion = self.positions.tolist()
        return Pose3((x, y, z), orientation_of(quaternion))

    def state(self) -> BodyState:
        """Return pose and velocity of its frame."""
        pose = self.pose
        vx, vy, vz, *turn = self.velocities.tolist()
        angular = rotate(pose.orientation, (turn[0], turn[1], turn[2])) if turn else (0.0, 0.0, 0.0)
        return BodyState(*pose, (vx, vy, vz), angular)

    def place(self, pose: Pose3) -> None:
        """Set its pose, without a check."""
        self.positions[:] = (*pose.position, *wxyz(pose.orientation))
        self._world.positions_changed()

    def set_state(self, state: BodyState) -> None:
        """Set its pose and velocity, without a check."""
        self.place(Pose3(state.position, state.orientation))
        self.velocities[:] = (*state.linear, *rotate_inverse(state.orientation, state.angular))

    def follow_path(self, seconds: float, step: float) -> None:
        """Place a moving body on its path at a time [s], with the speed that keeps it on the path in the next step."""
        path = self.body.path
        assert path is not None
        here, there = path.position_at(seconds), path.position_at(seconds + step)
        for axis, origin in enumerate(self.body.pose.position):
            self.positions[axis] = here[axis] - origin
            self.velocities[axis] = (there[axis] - here[axis]) / step


def _moved(old: Floats, new: Floats) -> Floats:
    """Copy one array into another of the same length, and return that."""
    new[:] = old
    return new
