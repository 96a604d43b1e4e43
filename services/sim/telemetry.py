"""What one robot tells: odometry, ground truth, joints, sensors and its base's state, each on its topic."""

from __future__ import annotations

from functools import cache
from typing import Any

from messages.elea import BaseStatus
from messages.geometry import Twist, TwistStamped
from messages.nav import Odometry
from messages.std import Header, String, Time
from messages.topics import (
    BASE_STATUS,
    CAMERA_INFO,
    CMD_VEL_OUT,
    GROUND_TRUTH,
    IMAGE,
    IMU,
    JOINT_STATES,
    ODOM,
    RANGE,
    ROBOT_DESCRIPTION,
    SCAN,
    SONAR,
    Topic,
)
from models import model_path
from models.figures import Model
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.runtime.service import STEP_NS
from services.sim import RobotEntry
from services.sim.base.base import Base
from services.sim.joints.actuators import Actuators
from services.sim.physics.rotation import into_body
from services.sim.physics.world import BodyState, World
from services.sim.sensors.odometer import Odometer
from services.sim.sensors.odometry import world_odometry
from services.sim.sensors.photo import calibration, photograph
from services.sim.sensors.readings import imu, joint_state, noise_source, scan
from services.sim.sensors.sonar import cloud, measure, ranges_of, ring_of


class Telemetry:
    """The publications of one robot. What costs time to make is made only while somebody listens.

    ``noise`` tells whether its sensors have any.
    """

    def __init__(
        self,
        node: Node,
        world: World,
        entry: RobotEntry,
        model: Model,
        namespace: str,
        seed: int,
        base: Base | None,
        actuators: Actuators | None,
        odometer: Odometer,
        noise: bool,
    ) -> None:
        self._node, self._world, self._model, self._seed = node, world, model, seed
        self._base, self._actuators, self.odometer = base, actuators, odometer
        self._name = entry.name
        self.noise = noise
        self._joints = world.joints(entry.name)
        self.joint_steps = _steps(model.joint_rate or model.odometry_rate)
        topics: list[Topic[Any]] = [GROUND_TRUTH, JOINT_STATES, ROBOT_DESCRIPTION]
        topics += [] if model.fixed_base else [ODOM]
        topics += [BASE_STATUS] if base is not None else []
        topics += [CMD_VEL_OUT] if base is not None and base.settings.publish_cmd else []
        topics += [SCAN] if model.laser else []
        topics += [SONAR, RANGE] if model.sonar else []
        self._ring = ring_of(entry.model, model.sonar) if model.sonar else None
        topics += [IMU] if model.imu else []
        topics += [IMAGE, CAMERA_INFO] if model.camera else []
        self._out: dict[Topic[Any], Output[Any]] = {
            topic: node.write(topic, f"{namespace}/{topic.name}") for topic in topics
        }
        self._out[ROBOT_DESCRIPTION].publish(String(data=model_path(entry.model).read_text()))
        self._child = self.frame(model.base_frame)
        self.restart()

    def close(self) -> None:
        """Leave the network."""
        self._node.forget(*self._out.values())

    def restart(self) -> None:
        """Begin anew from where the body is."""
        self.odometer.restart()
        self.odometry: Odometry | None = None
        self._before: tuple[int, BodyState] | None = None

    def frame(self, link: str) -> str:
        """The frame of a link, prefixed by the robot's name."""
        return f"{self._name}/{link}"

    def joint_states(self, now: int, tick: int) -> None:
        """Publish the joints if they are due at ``tick``."""
        if self._joints and tick % self.joint_steps == 0 and self._out[JOINT_STATES].wanted:
            readings = self._world.joint_readings(self._name)
            if self._actuators is not None:
                readings = readings._replace(effort=tuple(self._actuators.applied.values()))
            self._out[JOINT_STATES].publish(joint_state(self._joints, readings, Header(stamp=Time.of(now))))

    def motion(self, now: int, tick: int) -> None:
        """At a control tick, publish what is due of ground truth, odometry and the limited command."""
        self.odometer.count(now)
        if CMD_VEL_OUT in self._out and self._base is not None:
            header = Header(stamp=Time.of(now), frame_id=self._child)
            twist = Twist.planar(*self._base.motion)
            self._out[CMD_VEL_OUT].publish(TwistStamped(header=header, twist=twist))
        told = _due(tick, self._model.odometry_rate)
        rate = self._model.odometry_rate if self._base is None else self._base.live.publish_rate
        counted = ODOM in self._out and self.odometer.due(now, rate)
        if not told and not counted:
            return
        state, stamp = self._world.state(self._name), Time.of(now)
        if told:
            self._out[GROUND_TRUTH].publish(world_odometry(state, Header(stamp=stamp, frame_id="world"), self._child))
        if counted:
            header = Header(stamp=stamp, frame_id=self.frame("odom"))
            self.odometry = self.odometer.message(header, self._child, state)
            self._out[ODOM].publish(self.odometry)

    def sensors(self, now: int, tick: int) -> None:
        """Publish the sensors that are due at ``tick``."""
        model = self._model
        if model.imu is not None and _due(tick, model.imu.rate):
            self._imu(now, tick)
        if model.laser is not None and _due(tick, model.laser.rate) and self._out[SCAN].wanted:
            header = Header(stamp=Time.of(now), frame_id=self.frame(model.laser.link))
            noise = noise_source(self._seed, self._name, "scan", tick) if self.noise else None
            self._out[SCAN].publish(scan(self._world, self._name, model.laser, header, noise))
        if model.sonar is not None and _due(tick, model.sonar.rate):
            self._sonar(now, tick)
        if model.camera is not None and _due(tick, model.camera.rate) and self._out[IMAGE].wanted:
            header = Header(stamp=Time.of(now), frame_id=self.frame(model.camera.link))
            self._out[CAMERA_INFO].publish(calibration(model.camera, header))
            self._out[IMAGE].publish(photograph(self._world, self._name, model.camera, header))

    def status(self, status: BaseStatus) -> None:
        """Publish the state of the base."""
        self._out[BASE_STATUS].publish(status)

    def _imu(self, now: int, tick: int) -> None:
        unit = self._model.imu
        assert unit is not None
        if not self._out[IMU].wanted:
            self._before = None
            return
        state, before = self._world.state(self._name), self._before
        self._before = now, state
        if before is None or before[0] >= now:
            return
        place = self._world.link_placement(self._name, unit.link).position
        apart = (place[0] - state.position[0], place[1] - state.position[1], place[2] - state.position[2])
        noise = noise_source(self._seed, self._name, "imu", tick) if self.noise else None
        header = Header(stamp=Time.of(now), frame_id=self.frame(unit.link))
        offset, dt = into_body(state.orientation, apart), (now - before[0]) / 1e9
        self._out[IMU].publish(imu(unit, offset, before[1], state, dt, header, noise))

    def _sonar(self, now: int, tick: int) -> None:
        ring, every, single = self._ring, self._out[SONAR], self._out[RANGE]
        assert ring is not None
        if not (every.wanted or single.wanted):
            return
        noise = noise_source(self._seed, self._name, "sonar", tick) if self.noise else None
        echoes = measure(self._world, self._name, ring, noise)
        stamp = Time.of(now)
        if every.wanted:
            every.publish(cloud(ring, echoes, Header(stamp=stamp, frame_id=self.frame(ring.figures.link))))
        if single.wanted:
            headers = [Header(stamp=stamp, frame_id=self.frame(link)) for link in ring.figures.links]
            for each in ranges_of(ring, echoes, headers):
                single.publish(each)


def _due(tick: int, rate: float) -> bool:
    """Whether something of this rate [Hz] happens at a physics step."""
    return tick % _steps(rate) == 0


@cache
def _steps(rate: float) -> int:
    return round(1e9 / rate / STEP_NS)
