"""The loop that a user of a physics engine would write: burgers that drive and scan, without any middleware."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from deploy.fleet import RobotConfig
from models import physics_urdf_path
from models.model import LaserConfig, WheelConfig, read_model
from services.runtime.step import STEP_NS
from services.sim.engines import Engine

SPEED, TURN = 4.0, 1.0
"""Wheel speed [rad/s], and its difference per robot: all drive in circles of different sizes."""
MOTOR_GAIN = 0.02
"""Gain of MuJoCo's velocity actuators [N m s/rad]; a stiffer one throws a burger on its back."""
LASER_HEIGHT = 0.18
"""Height of a burger's laser [m]."""


Loop = tuple[Callable[[], None], Callable[[], None]]
"""Functions that make a step, and that scan with all lasers."""


def raw_loop_factor(engine: Engine, robots: Sequence[RobotConfig], start_s: float, length_s: float) -> float:
    """Return simulated seconds per wall-clock second of an engine that steps robots of one model and casts their rays.

    Args:
        engine: Name of the engine.
        robots: The robots with their start poses.
        start_s: Simulation time before timing begins.
        length_s: Simulation time that is timed.
    """
    model = read_model(robots[0].model)
    assert model.wheels is not None
    assert model.laser is not None
    make = _bullet_loop if engine == "pybullet" else _mujoco_loop
    per_scan = round(1e9 / model.laser.rate / STEP_NS)
    first, last = (round(seconds * 1e9 / STEP_NS) for seconds in (start_s, start_s + length_s))
    began = 0.0
    with make(robots, model.wheels, model.laser) as (step, scan):
        for number in range(last):
            if number == first:
                began = time.perf_counter()
            step()
            if number % per_scan == 0:
                scan()
        return length_s / (time.perf_counter() - began)


def _speeds(number: int) -> tuple[float, float]:
    turn = TURN * math.sin(number)
    return SPEED - turn, SPEED + turn


def _rays(laser: LaserConfig) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    angles = np.linspace(0.0, math.tau, laser.samples, endpoint=False)
    return np.column_stack((np.cos(angles), np.sin(angles), np.zeros(laser.samples)))


@contextmanager
def _bullet_loop(robots: Sequence[RobotConfig], wheels: WheelConfig, laser: LaserConfig) -> Iterator[Loop]:
    from services.sim.physics._pybullet import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setTimeStep(STEP_NS / 1e9, client)
    pybullet.setGravity(0, 0, -9.81, client)
    pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client))
    bodies = []
    for number, robot in enumerate(robots):
        turned = pybullet.getQuaternionFromEuler((0, 0, robot.pose.yaw))
        place = (robot.pose.x, robot.pose.y, 0)
        body = pybullet.loadURDF(str(physics_urdf_path(robot.model)), place, turned, physicsClientId=client)
        names = {
            pybullet.getJointInfo(body, i, client)[1].decode(): i for i in range(pybullet.getNumJoints(body, client))
        }
        for joint, speed in zip((wheels.left_joint, wheels.right_joint), _speeds(number), strict=True):
            pybullet.setJointMotorControl2(
                body,
                names[joint],
                pybullet.VELOCITY_CONTROL,
                targetVelocity=speed,
                force=wheels.torque,
                physicsClientId=client,
            )
        bodies.append(body)
    rays = _rays(laser)

    def scan() -> None:
        for body in bodies:
            eye = np.add(pybullet.getBasePositionAndOrientation(body, client)[0], (0.0, 0.0, LASER_HEIGHT))
            pybullet.rayTestBatch(eye + laser.range_min * rays, eye + laser.range_max * rays, physicsClientId=client)

    try:
        yield lambda: pybullet.stepSimulation(client), scan
    finally:
        pybullet.disconnect(client)


@contextmanager
def _mujoco_loop(robots: Sequence[RobotConfig], wheels: WheelConfig, laser: LaserConfig) -> Iterator[Loop]:
    from services.sim.physics._mujoco import mujoco

    spec = mujoco.MjSpec()
    spec.option.timestep = STEP_NS / 1e9
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    for robot in robots:
        half = robot.pose.yaw / 2
        frame = spec.worldbody.add_frame(
            pos=[robot.pose.x, robot.pose.y, 0], quat=[math.cos(half), 0, 0, math.sin(half)]
        )
        urdf = mujoco.MjSpec.from_file(str(physics_urdf_path(robot.model)))
        frame.attach_body(urdf.worldbody.first_body(), f"{robot.name}/", "").add_freejoint()
        for joint in (wheels.left_joint, wheels.right_joint):
            name = f"{robot.name}/{joint}"
            spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_velocity(kv=MOTOR_GAIN)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = [speed for number in range(len(robots)) for speed in _speeds(number)]
    rays, count = _rays(laser), laser.samples
    shapes, distances = np.empty(count, np.int32), np.empty(count)
    roots = [model.joint(each).bodyid[0] for each in range(model.njnt) if model.jnt_type[each] == 0]

    def scan() -> None:
        for root in roots:
            eye = data.xpos[root] + (0.0, 0.0, LASER_HEIGHT)
            mujoco.mj_multiRay(
                model, data, eye, rays.ravel(), None, 1, root, shapes, distances, None, count, laser.range_max
            )

    yield lambda: mujoco.mj_step(model, data), scan
