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
from services.sim.snapshot import Snapshot

Floats = NDArray[np.float64]

SENSOR_STEPS = 2
"""Physics steps between two checks of what is due: no sensor is faster than 100 Hz."""


_IMU_ERRORS = 6
"""Noise values of an IMU per reading: three of the turn rate, three of the specific force."""


class NoiseSwitch(Protocol):
    """Whether the sensors of a robot currently have noise."""

    noise: bool


@dataclass(frozen=True)
class SensorContext:
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

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a reading, if the topic has subscribers."""
        ...


class ImuSensor:
    """An IMU. IMUs of one kind are read together by ``ImuGroup``."""

    def __init__(self, context: SensorContext, config: ImuConfig) -> None:
        self.steps, self.config, self.robot = steps_of(config.rate), config, context.robot
        self.publisher, self.noise_switch = context.publisher(IMU), context.noise_switch
        self.noise = context.noise("imu", self.steps, _IMU_ERRORS)
        frame = context.frame_id(config.mount.frame or config.link)
        self.template = Template(
            lambda stamp, numbers: imu_message(config, Header(stamp=stamp, frame_id=frame), numbers), 10
        )


class _SubscribedImus:
    """IMUs of one kind that have subscribers, read together."""

    def __init__(self, imus: Sequence[ImuSensor]) -> None:
        self.imus = tuple(imus)
        self.robots = tuple(each.robot for each in imus)
        self.links = tuple((each.robot, each.config.link) for each in imus)
        self.topics = RobotTopicGroup([each.publisher for each in imus], [each.template for each in imus])
        self._noise_switches = [each.noise_switch for each in imus]
        self._block, self._numbers = -1, np.empty((0, len(imus), _IMU_ERRORS))

    def errors(self, tick: int) -> Floats:
        """Return the noise numbers of each IMU, shape (n, 6); zeros for those without noise."""
        block, index = self.imus[0].noise.locate(tick)
        if block != self._block:
            self._block, self._numbers = block, np.stack([each.noise.block(block) for each in self.imus], axis=1)
        noisy = [each.noise for each in self._noise_switches]
        numbers: Floats = self._numbers[index]
        return numbers if all(noisy) else np.where(np.array(noisy)[:, None], numbers, 0.0)


class _ImuSnapshot(NamedTuple):
    """IMUs that were read together at ``now`` [ns], and the states of their bodies then, shape (n, 13)."""

    now: int
    imus: tuple[ImuSensor, ...]
    states: Floats


class ImuGroup:
    """IMUs of one kind. They measure over the time since the last reading, so the first one gives nothing."""

    def __init__(self, world: World, config: ImuConfig) -> None:
        self.imus: list[ImuSensor] = []
        self.steps = steps_of(config.rate)
        self._world, self._config = world, config
        self._period = math.lcm(self.steps, SENSOR_STEPS) * STEP_NS
        self._subscribed = _SubscribedImus(())
        self.reset()

    def reset(self) -> None:
        """Restart from where the bodies are."""
        self._previous: _ImuSnapshot | None = None

    def update_subscriptions(self) -> None:
        """Update which IMUs have subscribers."""
        imus = tuple(each for each in self.imus if each.publisher.has_subscribers)
        if imus != self._subscribed.imus:
            self._subscribed = _SubscribedImus(imus)

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a reading of each IMU that has subscribers."""
        subscribed = self._subscribed
        if not subscribed.imus:
            return
        states = snapshot.states(subscribed.robots)
        before, self._previous = self._previous, _ImuSnapshot(snapshot.now, subscribed.imus, states)
        if before is None or snapshot.now - before.now != self._period:
            return
        earlier = before.states
        if before.imus is not subscribed.imus:
            indices = {each: index for index, each in enumerate(before.imus)}
            states = states[[each in indices for each in subscribed.imus]]
            subscribed = _SubscribedImus([each for each in subscribed.imus if each in indices])
            earlier = earlier[[indices[each] for each in subscribed.imus]]
        if subscribed.imus:
            self._publish(snapshot, subscribed, earlier, states)

    def _publish(self, snapshot: Snapshot, subscribed: _SubscribedImus, before: Floats, states: Floats) -> None:
        poses = self._world.link_poses(subscribed.links)
        if self._config.mount != ON_LINK:
            rows: Any = poses.T
            poses = np.concatenate(Pose3(rows[:3], rows[3:]) @ self._config.mount.pose).T
        readings = imu_readings(
            self._config, poses, before, states, self._period / 1e9, subscribed.errors(snapshot.tick)
        )
        subscribed.topics.publish(snapshot.stamp, readings)


class LaserSensor:
    """A laser. Lasers of one kind that are due together are read together by ``publish_scans``."""

    def __init__(self, context: SensorContext, laser: LaserConfig) -> None:
        self.steps, self.laser, self.robot = steps_of(laser.rate), laser, context.robot
        self.publisher, self.frame = context.publisher(SCAN), context.frame_id(laser.mount.frame or laser.link)
        self._context, self._noise = context, context.noise("scan", self.steps, laser.samples)

    def noise(self, tick: int) -> Floats | None:
        """Return the noise numbers at a tick; None without noise."""
        return self._noise.at(tick) if self._context.noise_switch.noise else None


def publish_scans(world: World, lasers: Iterable[LaserSensor], snapshot: Snapshot) -> None:
    """Publish a scan of each of the lasers that has subscribers."""
    kinds: dict[LaserConfig, list[LaserSensor]] = {}
    for each in lasers:
        if each.publisher.has_subscribers:
            kinds.setdefault(each.laser, []).append(each)
    stamp = Time.of(snapshot.now)
    for laser, alike in kinds.items():
        noise = [each.noise(snapshot.tick) for each in alike]
        ranges = laser_ranges(world, [each.robot for each in alike], laser, noise)
        for each, row in zip(alike, ranges, strict=True):
            each.publisher.publish(laser_scan(laser, row, Header(stamp=stamp, frame_id=each.frame)))


class SonarSensor:
    """A ring of sonars."""

    def __init__(self, context: SensorContext, sonar: SonarConfig) -> None:
        self.steps, self._context = steps_of(sonar.rate), context
        self._ring, self._noise = sonar_ring(context.model, sonar), context.noise("sonar", self.steps, len(sonar.links))
        self._every, self._single = context.publisher(SONAR), context.publisher(RANGE)

    def publish(self, snapshot: Snapshot) -> None:
        every, single, ring = self._every.has_subscribers, self._single.has_subscribers, self._ring
        if not (every or single):
            return
        context = self._context
        noise = self._noise.at(snapshot.tick) if context.noise_switch.noise else None
        echoes = sonar_ranges(context.world, context.robot, ring, noise)
        stamp = Time.of(snapshot.now)
        if every:
            header = Header(stamp=stamp, frame_id=context.frame_id(ring.config.link))
            self._every.publish(sonar_cloud(ring, echoes, header))
        if single:
            headers = [Header(stamp=stamp, frame_id=context.frame_id(link)) for link in ring.config.links]
            for each in range_messages(ring, echoes, headers):
                self._single.publish(each)


class CameraSensor:
    """A camera; its calibration is published beside each image, and also while only that has subscribers."""

    def __init__(self, context: SensorContext, camera: CameraConfig) -> None:
        self.steps, self._context, self._camera = steps_of(camera.rate), context, camera
        self._images, self._infos = context.publisher(IMAGE), context.publisher(CAMERA_INFO)
        self._frame = context.frame_id(camera.mount.frame or camera.link)
        self._draws = True

    def publish(self, snapshot: Snapshot) -> None:
        draws = self._draws and self._images.has_subscribers
        if not (draws or self._infos.has_subscribers):
            return
        header = Header(stamp=Time.of(snapshot.now), frame_id=self._frame)
        if not draws:
            self._infos.publish(camera_info(self._camera, header))
            return
        try:
            image = camera_image(self._context.world, self._context.robot, self._camera, header)
        except BadInput as error:
            # The engine cannot draw here: the robot drives on without its camera.
            self._draws = False
            self._context.warn(f"{self._context.robot}: {error}")
            return
        self._infos.publish(camera_info(self._camera, header))
        self._images.publish(image)


AnySensor = Sensor | ImuSensor | LaserSensor


def robot_sensors(context: SensorContext, model: RobotModel) -> list[AnySensor]:
    """Create the sensors of a robot."""
    sensors: list[AnySensor] = []
    if model.imu is not None:
        sensors.append(ImuSensor(context, model.imu))
    if model.laser is not None:
        sensors.append(LaserSensor(context, model.laser))
    if model.sonar is not None:
        sensors.append(SonarSensor(context, model.sonar))
    if model.camera is not None:
        sensors.append(CameraSensor(context, model.camera))
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
            group.imus = []
        self._lasers: dict[int, list[LaserSensor]] = {}
        self._others: dict[int, list[Sensor]] = {}
        for each in sensors:
            if isinstance(each, ImuSensor):
                if each.config not in self._imus:
                    self._imus[each.config] = ImuGroup(self._world, each.config)
                self._imus[each.config].imus.append(each)
            elif isinstance(each, LaserSensor):
                self._lasers.setdefault(each.steps, []).append(each)
            else:
                self._others.setdefault(each.steps, []).append(each)

    def update_subscriptions(self) -> None:
        """Update which IMUs have subscribers."""
        for group in self._imus.values():
            group.update_subscriptions()

    def reset(self) -> None:
        """Restart from where the bodies are."""
        for group in self._imus.values():
            group.reset()

    def publish(self, snapshot: Snapshot) -> None:
        """Publish the readings that are due."""
        tick = snapshot.tick
        if tick % SENSOR_STEPS:
            return
        for group in self._imus.values():
            if tick % group.steps == 0:
                group.publish(snapshot)
        for steps, lasers in self._lasers.items():
            if tick % steps == 0:
                publish_scans(self._world, lasers, snapshot)
        for steps, others in self._others.items():
            if tick % steps == 0:
                for each in others:
                    each.publish(snapshot)
