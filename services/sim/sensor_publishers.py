"""The publishers of the robots' sensors. What takes time to measure is measured only while somebody subscribes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from messages.se3 import quaternion_conjugate, quaternion_multiply, rotate_inverse
from messages.std import Header, Time
from messages.template import Template
from messages.topics import CAMERA_INFO, IMAGE, IMU, RANGE, SCAN, SONAR, Topic
from models.model import ON_LINK, CameraConfig, ImuConfig, LaserConfig, RobotModel, SonarConfig
from services.runtime.errors import BadInput
from services.runtime.step import STEP_NS
from services.sim.moment import Moment
from services.sim.noise import NoiseSource
from services.sim.physics.world import BodyState, World
from services.sim.robot_topics import RobotPublisher, steps_of
from services.sim.sensors import (
    camera_image,
    camera_info,
    imu_message,
    imu_reading,
    laser_ranges,
    laser_scan,
    range_messages,
    sonar_cloud,
    sonar_ranges,
    sonar_ring,
)

SENSOR_STEPS = 2
"""Physics steps between two looks at the sensors: none is faster than 100 Hz."""

ALIGNED = 1 - 1e-9
"""Cosine of half the angle up to which an inertial unit has the axes of its body."""


@dataclass(frozen=True)
class SensorMount:
    """What the sensors of one robot share.

    ``publisher`` advertises a topic of the robot, ``frame_id`` gives the id of a frame, ``noisy`` tells whether its
    sensors have noise now, ``warn`` logs a warning.
    """

    world: World
    robot: str
    model: str
    seed: int
    publisher: Callable[[Topic[Any]], RobotPublisher]
    frame_id: Callable[[str], str]
    noisy: Callable[[], bool]
    warn: Callable[[str], None]

    def noise(self, sensor: str, steps: int) -> NoiseSource:
        """The noise of a sensor that is read every ``steps`` physics steps."""
        return NoiseSource(self.seed, self.robot, sensor, steps)


class Sensor(Protocol):
    """A sensor of a robot, read every ``steps`` physics steps."""

    steps: int

    def publish(self, moment: Moment) -> None:
        """Publish a reading, if anybody reads it."""
        ...

    def reset(self) -> None:
        """Start over from where the body is."""
        ...


class ImuSensor:
    """An inertial unit: it measures over the time since the look before, so that the first look gives nothing."""

    def __init__(self, mount: SensorMount, unit: ImuConfig) -> None:
        self.steps, self.robot = steps_of(unit.rate), mount.robot
        self._mount, self._unit, self._body = mount, unit, mount.world.body(mount.robot)
        self.publisher, self._noise = mount.publisher(IMU), mount.noise("imu", self.steps)
        frame = mount.frame_id(unit.mount.frame or unit.link)
        self._period = math.lcm(self.steps, SENSOR_STEPS) * STEP_NS
        self._template = Template(
            lambda stamp, numbers: imu_message(unit, Header(stamp=stamp, frame_id=frame), numbers), 10
        )
        self.reset()

    def reset(self) -> None:
        self._before: tuple[int, BodyState] | None = None

    def publish(self, moment: Moment) -> None:
        """Publish a reading, whether anybody reads it or not."""
        now, state, before = moment.now, moment.state(self.robot), self._before
        self._before = now, state
        if before is None or now - before[0] != self._period:
            return
        unit = self._unit
        pose = self._body.link_pose(unit.link)
        pose = pose if unit.mount == ON_LINK else pose @ unit.mount.pose
        (x, y, z), (a, b, c) = pose.position, state.position
        offset, dt = rotate_inverse(state.orientation, (x - a, y - b, z - c)), (now - before[0]) / 1e9
        turned = abs(quaternion_multiply(quaternion_conjugate(state.orientation), pose.orientation)[3]) < ALIGNED
        noise = self._noise.at(moment.tick) if self._mount.noisy() else None
        reading = imu_reading(unit, offset, before[1], state, dt, noise, pose.orientation if turned else None)
        numbers = (*reading.orientation, *reading.rate, *reading.force)
        self.publisher.publish_encoded(self._template.encode(moment.stamp, numbers))


class LaserSensor:
    """A laser. Lasers of one kind that are due together are read in one go by ``publish_scans``."""

    def __init__(self, mount: SensorMount, laser: LaserConfig) -> None:
        self.steps, self.laser, self.robot = steps_of(laser.rate), laser, mount.robot
        self.publisher, self.frame = mount.publisher(SCAN), mount.frame_id(laser.mount.frame or laser.link)
        self._mount, self._noise = mount, mount.noise("scan", self.steps)

    def noise(self, tick: int) -> Any:
        """The generator of the noise at a tick; None without noise."""
        return self._noise.at(tick) if self._mount.noisy() else None

    def reset(self) -> None:
        pass


def publish_scans(world: World, lasers: Iterable[LaserSensor], moment: Moment) -> None:
    """Publish a turn of each of the lasers that is read by anybody."""
    kinds: dict[LaserConfig, list[LaserSensor]] = {}
    for each in lasers:
        if each.publisher.has_subscribers:
            kinds.setdefault(each.laser, []).append(each)
    stamp = Time.of(moment.now)
    for laser, alike in kinds.items():
        noise = [each.noise(moment.tick) for each in alike]
        ranges = laser_ranges(world, [each.robot for each in alike], laser, noise)
        for each, row in zip(alike, ranges, strict=True):
            each.publisher.publish(laser_scan(laser, row, Header(stamp=stamp, frame_id=each.frame)))


class SonarSensor:
    """A ring of sonars."""

    def __init__(self, mount: SensorMount, sonar: SonarConfig) -> None:
        self.steps, self._mount = steps_of(sonar.rate), mount
        self._ring, self._noise = sonar_ring(mount.model, sonar), mount.noise("sonar", self.steps)
        self._every, self._single = mount.publisher(SONAR), mount.publisher(RANGE)

    def publish(self, moment: Moment) -> None:
        every, single, ring = self._every.has_subscribers, self._single.has_subscribers, self._ring
        if not (every or single):
            return
        mount = self._mount
        noise = self._noise.at(moment.tick) if mount.noisy() else None
        echoes = sonar_ranges(mount.world, mount.robot, ring, noise)
        stamp = Time.of(moment.now)
        if every:
            header = Header(stamp=stamp, frame_id=mount.frame_id(ring.config.link))
            self._every.publish(sonar_cloud(ring, echoes, header))
        if single:
            headers = [Header(stamp=stamp, frame_id=mount.frame_id(link)) for link in ring.config.links]
            for each in range_messages(ring, echoes, headers):
                self._single.publish(each)

    def reset(self) -> None:
        pass


class CameraSensor:
    """A camera, with its calibration beside each picture."""

    def __init__(self, mount: SensorMount, camera: CameraConfig) -> None:
        self.steps, self._mount, self._camera = steps_of(camera.rate), mount, camera
        self._images, self._infos = mount.publisher(IMAGE), mount.publisher(CAMERA_INFO)
        self._frame = mount.frame_id(camera.mount.frame or camera.link)
        self._draws = True

    def publish(self, moment: Moment) -> None:
        if not (self._draws and self._images.has_subscribers):
            return
        header = Header(stamp=Time.of(moment.now), frame_id=self._frame)
        try:
            image = camera_image(self._mount.world, self._mount.robot, self._camera, header)
        except BadInput as error:
            # The engine cannot draw here: the robot drives on without its camera.
            self._draws = False
            self._mount.warn(f"{self._mount.robot}: {error}")
            return
        self._infos.publish(camera_info(self._camera, header))
        self._images.publish(image)

    def reset(self) -> None:
        pass


def robot_sensors(mount: SensorMount, model: RobotModel) -> list[Sensor | LaserSensor]:
    """The sensors of a robot."""
    sensors: list[Sensor | LaserSensor] = []
    if model.imu is not None:
        sensors.append(ImuSensor(mount, model.imu))
    if model.laser is not None:
        sensors.append(LaserSensor(mount, model.laser))
    if model.sonar is not None:
        sensors.append(SonarSensor(mount, model.sonar))
    if model.camera is not None:
        sensors.append(CameraSensor(mount, model.camera))
    return sensors


class SensorSchedule:
    """The sensors of all robots, by how often they are read."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.replace(())

    def replace(self, sensors: Iterable[Sensor | LaserSensor]) -> None:
        """From now on these are the sensors."""
        self._imus: dict[int, list[ImuSensor]] = {}
        self._lasers: dict[int, list[LaserSensor]] = {}
        self._others: dict[int, list[Sensor]] = {}
        for each in sensors:
            if isinstance(each, ImuSensor):
                self._imus.setdefault(each.steps, []).append(each)
            elif isinstance(each, LaserSensor):
                self._lasers.setdefault(each.steps, []).append(each)
            else:
                self._others.setdefault(each.steps, []).append(each)

    def publish(self, moment: Moment) -> None:
        """Publish what is due at this moment."""
        tick = moment.tick
        if tick % SENSOR_STEPS:
            return
        for steps, imus in self._imus.items():
            if tick % steps == 0:
                wanted = [each for each in imus if each.publisher.has_subscribers]
                moment.read_states([each.robot for each in wanted])
                for imu in wanted:
                    imu.publish(moment)
        for steps, lasers in self._lasers.items():
            if tick % steps == 0:
                publish_scans(self._world, lasers, moment)
        for steps, others in self._others.items():
            if tick % steps == 0:
                for each in others:
                    each.publish(moment)
