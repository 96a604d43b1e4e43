"""The publishers of the robots' sensors. Costly readings are taken only while the topic has subscribers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3
from messages.std import Header, Time
from messages.template import Template
from messages.topics import CAMERA_INFO, IMAGE, IMU, RANGE, SCAN, SONAR, Topic
from models.model import ON_LINK, CameraConfig, ImuConfig, LaserConfig, RobotModel, SonarConfig
from services.runtime.errors import BadInput
from services.runtime.step import STEP_NS
from services.sim.moment import Moment
from services.sim.noise import NoiseSource
from services.sim.physics.world import World
from services.sim.robot_topics import RobotPublisher, RobotTopicGroup, steps_of
from services.sim.sensors import (
    camera_image,
    camera_info,
    imu_message,
    imu_readings,
    laser_ranges,
    laser_scan,
    range_messages,
    sonar_cloud,
    sonar_ranges,
    sonar_ring,
)

Floats = NDArray[np.float64]

SENSOR_STEPS = 2
"""Physics steps between two checks of what is due: no sensor is faster than 100 Hz."""


_IMU_ERRORS = 6
"""Noise values of an IMU per reading: three of the turn rate, three of the specific force."""


class NoiseSwitch(Protocol):
    """Whether the sensors of a robot currently have noise."""

    noise: bool


@dataclass(frozen=True)
class SensorMount:
    """The context shared by the sensors of one robot.

    ``publisher`` advertises a topic of the robot, ``frame_id`` adds the robot's prefix to a frame, ``warn`` logs a
    warning.
    """

    world: World
    robot: str
    model: str
    seed: int
    publisher: Callable[[Topic[Any]], RobotPublisher]
    frame_id: Callable[[str], str]
    noise_switch: NoiseSwitch
    warn: Callable[[str], None]

    def noise(self, sensor: str, steps: int, count: int) -> NoiseSource:
        """Return the noise of a sensor read every ``steps`` physics steps, ``count`` numbers each time."""
        return NoiseSource(self.seed, self.robot, sensor, steps, count)


class Sensor(Protocol):
    """A sensor of a robot, read every ``steps`` physics steps."""

    steps: int

    def publish(self, moment: Moment) -> None:
        """Publish a reading, if the topic has subscribers."""
        ...


class ImuSensor:
    """An IMU. IMUs of one kind are read together by ``ImuGroup``."""

    def __init__(self, mount: SensorMount, unit: ImuConfig) -> None:
        self.steps, self.unit, self.robot = steps_of(unit.rate), unit, mount.robot
        self.publisher, self.noise_switch = mount.publisher(IMU), mount.noise_switch
        self.noise = mount.noise("imu", self.steps, _IMU_ERRORS)
        frame = mount.frame_id(unit.mount.frame or unit.link)
        self.template = Template(
            lambda stamp, numbers: imu_message(unit, Header(stamp=stamp, frame_id=frame), numbers), 10
        )


class _ImuReadings:
    """IMUs that are read together."""

    def __init__(self, units: Sequence[ImuSensor]) -> None:
        self.units = tuple(units)
        self.robots = tuple(each.robot for each in units)
        self.links = tuple((each.robot, each.unit.link) for each in units)
        self.topics = RobotTopicGroup([each.publisher for each in units], [each.template for each in units])
        self._noise_switches = [each.noise_switch for each in units]
        self._block, self._numbers = -1, np.empty((0, len(units), _IMU_ERRORS))

    def errors(self, tick: int) -> Floats:
        """Return the noise numbers of each IMU, shape (n, 6); zeros for those without noise."""
        block, place = self.units[0].noise.place(tick)
        if block != self._block:
            self._block, self._numbers = block, np.stack([each.noise.block(block) for each in self.units], axis=1)
        noisy = [each.noise for each in self._noise_switches]
        numbers: Floats = self._numbers[place]
        return numbers if all(noisy) else np.where(np.array(noisy)[:, None], numbers, 0.0)


class _ImuLook(NamedTuple):
    """IMUs that were read together at ``now`` [ns], and the states of their bodies then, shape (n, 13)."""

    now: int
    units: tuple[ImuSensor, ...]
    states: Floats


class ImuGroup:
    """IMUs of one kind. They measure over the time since the last reading, so the first one gives nothing."""

    def __init__(self, world: World, unit: ImuConfig) -> None:
        self.units: list[ImuSensor] = []
        self.steps = steps_of(unit.rate)
        self._world, self._unit = world, unit
        self._period = math.lcm(self.steps, SENSOR_STEPS) * STEP_NS
        self._read = _ImuReadings(())
        self.reset()

    def reset(self) -> None:
        """Restart from where the bodies are."""
        self._look: _ImuLook | None = None

    def update_readers(self) -> None:
        """Update which IMUs have subscribers."""
        units = tuple(each for each in self.units if each.publisher.has_subscribers)
        if units != self._read.units:
            self._read = _ImuReadings(units)

    def publish(self, moment: Moment) -> None:
        """Publish a reading of each IMU that has subscribers."""
        read = self._read
        states = moment.states(read.robots)
        before, self._look = self._look, _ImuLook(moment.now, read.units, states)
        if before is None or moment.now - before.now != self._period:
            return
        earlier = before.states
        if before.units is not read.units:
            places = {each: place for place, each in enumerate(before.units)}
            states = states[[each in places for each in read.units]]
            read = _ImuReadings([each for each in read.units if each in places])
            earlier = earlier[[places[each] for each in read.units]]
        if read.units:
            self._publish(moment, read, earlier, states)

    def _publish(self, moment: Moment, read: _ImuReadings, before: Floats, states: Floats) -> None:
        poses = self._world.link_poses(read.links)
        if self._unit.mount != ON_LINK:
            places: Any = poses.T
            poses = np.concatenate(Pose3(places[:3], places[3:]) @ self._unit.mount.pose).T
        readings = imu_readings(self._unit, poses, before, states, self._period / 1e9, read.errors(moment.tick))
        read.topics.publish(moment.stamp, readings)


class LaserSensor:
    """A laser. Lasers of one kind that are due together are read together by ``publish_scans``."""

    def __init__(self, mount: SensorMount, laser: LaserConfig) -> None:
        self.steps, self.laser, self.robot = steps_of(laser.rate), laser, mount.robot
        self.publisher, self.frame = mount.publisher(SCAN), mount.frame_id(laser.mount.frame or laser.link)
        self._mount, self._noise = mount, mount.noise("scan", self.steps, laser.samples)

    def noise(self, tick: int) -> Floats | None:
        """Return the noise numbers at a tick; None without noise."""
        return self._noise.at(tick) if self._mount.noise_switch.noise else None


def publish_scans(world: World, lasers: Iterable[LaserSensor], moment: Moment) -> None:
    """Publish a scan of each of the lasers that has subscribers."""
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
        self._ring, self._noise = sonar_ring(mount.model, sonar), mount.noise("sonar", self.steps, len(sonar.links))
        self._every, self._single = mount.publisher(SONAR), mount.publisher(RANGE)

    def publish(self, moment: Moment) -> None:
        every, single, ring = self._every.has_subscribers, self._single.has_subscribers, self._ring
        if not (every or single):
            return
        mount = self._mount
        noise = self._noise.at(moment.tick) if mount.noise_switch.noise else None
        echoes = sonar_ranges(mount.world, mount.robot, ring, noise)
        stamp = Time.of(moment.now)
        if every:
            header = Header(stamp=stamp, frame_id=mount.frame_id(ring.config.link))
            self._every.publish(sonar_cloud(ring, echoes, header))
        if single:
            headers = [Header(stamp=stamp, frame_id=mount.frame_id(link)) for link in ring.config.links]
            for each in range_messages(ring, echoes, headers):
                self._single.publish(each)


class CameraSensor:
    """A camera; its calibration is published beside each image."""

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


AnySensor = Sensor | ImuSensor | LaserSensor


def robot_sensors(mount: SensorMount, model: RobotModel) -> list[AnySensor]:
    """Create the sensors of a robot."""
    sensors: list[AnySensor] = []
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
    """The sensors of all robots, by their period."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._imus: dict[ImuConfig, ImuGroup] = {}
        self.replace(())

    def replace(self, sensors: Iterable[AnySensor]) -> None:
        """Replace all sensors."""
        for group in self._imus.values():
            group.units = []
        self._lasers: dict[int, list[LaserSensor]] = {}
        self._others: dict[int, list[Sensor]] = {}
        for each in sensors:
            if isinstance(each, ImuSensor):
                if each.unit not in self._imus:
                    self._imus[each.unit] = ImuGroup(self._world, each.unit)
                self._imus[each.unit].units.append(each)
            elif isinstance(each, LaserSensor):
                self._lasers.setdefault(each.steps, []).append(each)
            else:
                self._others.setdefault(each.steps, []).append(each)

    def update_readers(self) -> None:
        """Update which IMUs have subscribers."""
        for group in self._imus.values():
            group.update_readers()

    def reset(self) -> None:
        """Restart from where the bodies are."""
        for group in self._imus.values():
            group.reset()

    def publish(self, moment: Moment) -> None:
        """Publish the readings that are due."""
        tick = moment.tick
        if tick % SENSOR_STEPS:
            return
        for group in self._imus.values():
            if tick % group.steps == 0:
                group.publish(moment)
        for steps, lasers in self._lasers.items():
            if tick % steps == 0:
                publish_scans(self._world, lasers, moment)
        for steps, others in self._others.items():
            if tick % steps == 0:
                for each in others:
                    each.publish(moment)
