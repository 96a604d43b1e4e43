"""The publishers of each robot's topics, and of Gazebo's states of all models and links."""

from __future__ import annotations

from functools import cache
from typing import Any

from messages.base import Message
from messages.elea import BaseStatus
from messages.gazebo import LinkStates, ModelStates, WorldStates
from messages.geometry import Twist, TwistStamped
from messages.names import join
from messages.nav import Odometry
from messages.se3 import quaternion_conjugate, quaternion_multiply, rotate_inverse
from messages.std import Header, String, Time
from messages.topics import (
    BASE_STATUS,
    CAMERA_INFO,
    CMD_VEL_OUT,
    GROUND_TRUTH,
    IMAGE,
    IMU,
    JOINT_FEEDBACK,
    JOINT_STATES,
    LINK_STATES,
    MODEL_STATES,
    ODOM,
    RANGE,
    ROBOT_DESCRIPTION,
    SCAN,
    SONAR,
    WORLD_STATES,
    Topic,
)
from models import urdf_path
from models.model import ON_LINK, CameraConfig, ImuConfig, LaserConfig, RobotModel
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.step import STEP_NS
from services.sim.actuation import Actuation
from services.sim.drive.odometry import world_odometry
from services.sim.entities import pose_and_twist
from services.sim.joints.motors import JointMotors
from services.sim.parameters import RobotEntry
from services.sim.physics.world import BodyState, World
from services.sim.robot_names import robot_frame_prefix
from services.sim.sensors import (
    camera_image,
    camera_info,
    imu_reading,
    joint_state,
    laser_scan,
    noise_generator,
    range_messages,
    sonar_cloud,
    sonar_ranges,
    sonar_ring,
)

ALIGNED = 1 - 1e-9
"""Cosine of half the angle up to which an inertial unit has the axes of its body."""


def topic_names(topic: Topic[Any], model: RobotModel, namespace: str) -> list[str]:
    """What a topic of a robot is called: by its name here, and by the one that the robot's tags give it.

    The second one is relative to the robot's namespace, also where the tag begins it with a slash or with the
    namespace itself: tags are written for the one robot of a network.
    """
    names = [join(namespace, topic.name)]
    if other := model.topics.get(topic.name):
        names.append(join(namespace, f"/{other}".removeprefix(namespace.rstrip("/") + "/").strip("/")))
    return list(dict.fromkeys(names))


class RobotPublisher:
    """A topic of a robot, published under each of its names."""

    def __init__(self, node: Node, topic: Topic[Any], names: list[str]) -> None:
        self.ends: list[Publisher[Any]] = [node.advertise(topic, name) for name in names]

    @property
    def has_subscribers(self) -> bool:
        """Whether anybody reads any of them."""
        return any(each.has_subscribers for each in self.ends)

    def publish(self, message: Message) -> None:
        """Publish under all names."""
        for each in self.ends:
            each.publish(message)


class RobotPublishers:
    """The publications of one robot. What takes time to make is made only while somebody subscribes."""

    def __init__(
        self,
        node: Node,
        world: World,
        entry: RobotEntry,
        model: RobotModel,
        namespace: str,
        seed: int,
        actuation: Actuation,
        motors: JointMotors,
    ) -> None:
        self._node, self._world, self._model, self._seed = node, world, model, seed
        self._actuation, self.odometer, self._name = actuation, actuation.odometer, entry.name
        self._motors, self._namespace = motors, namespace
        self._frame_prefix = robot_frame_prefix(entry)
        self._body = world.body(entry.name)
        self._joints = self._body.joints
        self.joint_state_steps = max(1, _steps(entry.joint_state_rate or model.joint_rate or model.odometry_rate))
        topics: list[Topic[Any]] = [GROUND_TRUTH, JOINT_STATES, ROBOT_DESCRIPTION]
        topics += [] if model.fixed_base else [ODOM]
        topics += actuation.extra_topics
        topics += [SCAN] if model.laser else []
        topics += [SONAR, RANGE] if model.sonar else []
        self._sonar_ring = sonar_ring(entry.model, model.sonar) if model.sonar else None
        topics += [IMU] if model.imu else []
        topics += [IMAGE, CAMERA_INFO] if model.camera else []
        self._publishers: dict[Topic[Any], RobotPublisher] = {
            topic: RobotPublisher(node, topic, topic_names(topic, model, namespace)) for topic in topics
        }
        self._publishers[ROBOT_DESCRIPTION].publish(String(data=urdf_path(entry.model).read_text(encoding="utf-8")))
        self._base_frame = self.frame_id(model.base_frame)
        self.reset()

    def close(self) -> None:
        """Leave the network."""
        self._node.unregister(*(end for each in self._publishers.values() for end in each.ends))

    def reset(self) -> None:
        """Start over from where the body is."""
        self.odometer.reset()
        self.odometry: Odometry | None = None
        self._previous_state: tuple[int, BodyState] | None = None

    def frame_id(self, link: str) -> str:
        """The frame of a link, with the robot's frame prefix."""
        return f"{self._frame_prefix}{link}"

    def _sensor_frame(self, sensor: LaserConfig | ImuConfig | CameraConfig) -> str:
        return self.frame_id(sensor.mount.frame or sensor.link)

    def publish_joint_states(self, now: int, tick: int) -> None:
        """Publish the joints if they are due at ``tick``, and to a controller manager at each."""
        due = self._joints and tick % self.joint_state_steps == 0 and self._publishers[JOINT_STATES].has_subscribers
        if not due and not self._motors.commanded:
            return
        readings = self._motors.readings(self._actuation.joint_readings)
        state = joint_state(self._joints, readings, Header(stamp=Time.of(now)))
        if due:
            self._publishers[JOINT_STATES].publish(state)
        if self._motors.commanded:
            if JOINT_FEEDBACK not in self._publishers:
                feedback = RobotPublisher(
                    self._node, JOINT_FEEDBACK, topic_names(JOINT_FEEDBACK, self._model, self._namespace)
                )
                self._publishers[JOINT_FEEDBACK] = feedback
            self._publishers[JOINT_FEEDBACK].publish(state)

    def publish_motion(self, now: int, tick: int) -> None:
        """At a control tick, publish what is due of ground truth, odometry and the limited command."""
        self.odometer.update_from_encoders(now)
        if CMD_VEL_OUT in self._publishers:
            header = Header(stamp=Time.of(now), frame_id=self._base_frame)
            twist = Twist.planar(*self._actuation.commanded_velocity)
            self._publishers[CMD_VEL_OUT].publish(TwistStamped(header=header, twist=twist))
        truth_due = _due(tick, self._model.odometry_rate)
        odometry_due = ODOM in self._publishers and self.odometer.due(now, self._actuation.odometry_rate)
        if not truth_due and not odometry_due:
            return
        state, stamp = self._body.state(), Time.of(now)
        if truth_due:
            self._publishers[GROUND_TRUTH].publish(
                world_odometry(state, Header(stamp=stamp, frame_id="world"), self._base_frame)
            )
        if odometry_due:
            header = Header(stamp=stamp, frame_id=self.frame_id(self._model.odom_frame))
            self.odometry = self.odometer.to_message(header, self._base_frame, state)
            self._publishers[ODOM].publish(self.odometry)

    def publish_sensors(self, now: int, tick: int) -> None:
        """Publish the sensors that are due at ``tick``."""
        model = self._model
        if model.imu is not None and _due(tick, model.imu.rate):
            self._publish_imu(now, tick)
        if model.laser is not None and _due(tick, model.laser.rate) and self._publishers[SCAN].has_subscribers:
            header = Header(stamp=Time.of(now), frame_id=self._sensor_frame(model.laser))
            noise = noise_generator(self._seed, self._name, "scan", tick) if self._actuation.noise else None
            self._publishers[SCAN].publish(laser_scan(self._world, self._name, model.laser, header, noise))
        if model.sonar is not None and _due(tick, model.sonar.rate):
            self._publish_sonar(now, tick)
        if model.camera is not None and _due(tick, model.camera.rate) and self._publishers[IMAGE].has_subscribers:
            header = Header(stamp=Time.of(now), frame_id=self._sensor_frame(model.camera))
            self._publishers[CAMERA_INFO].publish(camera_info(model.camera, header))
            self._publishers[IMAGE].publish(camera_image(self._world, self._name, model.camera, header))

    def publish_status(self, status: BaseStatus) -> None:
        """Publish the state of the base."""
        self._publishers[BASE_STATUS].publish(status)

    def _publish_imu(self, now: int, tick: int) -> None:
        unit = self._model.imu
        assert unit is not None
        if not self._publishers[IMU].has_subscribers:
            self._previous_state = None
            return
        state, before = self._body.state(), self._previous_state
        self._previous_state = now, state
        if before is None or before[0] >= now:
            return
        pose = self._body.link_pose(unit.link)
        pose = pose if unit.mount == ON_LINK else pose @ unit.mount.pose
        place = pose.position
        apart = (place[0] - state.position[0], place[1] - state.position[1], place[2] - state.position[2])
        noise = noise_generator(self._seed, self._name, "imu", tick) if self._actuation.noise else None
        header = Header(stamp=Time.of(now), frame_id=self._sensor_frame(unit))
        offset, dt = rotate_inverse(state.orientation, apart), (now - before[0]) / 1e9
        turned = abs(quaternion_multiply(quaternion_conjugate(state.orientation), pose.orientation)[3]) < ALIGNED
        axes = pose.orientation if turned else None
        self._publishers[IMU].publish(imu_reading(unit, offset, before[1], state, dt, header, noise, axes))

    def _publish_sonar(self, now: int, tick: int) -> None:
        ring, every, single = self._sonar_ring, self._publishers[SONAR], self._publishers[RANGE]
        assert ring is not None
        if not (every.has_subscribers or single.has_subscribers):
            return
        noise = noise_generator(self._seed, self._name, "sonar", tick) if self._actuation.noise else None
        echoes = sonar_ranges(self._world, self._name, ring, noise)
        stamp = Time.of(now)
        if every.has_subscribers:
            every.publish(sonar_cloud(ring, echoes, Header(stamp=stamp, frame_id=self.frame_id(ring.config.link))))
        if single.has_subscribers:
            headers = [Header(stamp=stamp, frame_id=self.frame_id(link)) for link in ring.config.links]
            for each in range_messages(ring, echoes, headers):
                single.publish(each)


def _due(tick: int, rate: float) -> bool:
    """Whether something of this rate [Hz] happens at a physics step."""
    return tick % _steps(rate) == 0


@cache
def _steps(rate: float) -> int:
    return round(1e9 / rate / STEP_NS)


class WorldStatesPublisher:
    """The world's movable and moving bodies, in the order of its file; nothing is advertised where there are none."""

    def __init__(self, node: Node, world: World) -> None:
        self._world = world
        self._publisher: Publisher[Any] | None = node.advertise(WORLD_STATES) if world.world_bodies else None

    def publish(self, now: int, tick: int) -> None:
        """Publish them if they are due at ``tick``, which is at ``now`` [ns]."""
        if self._publisher is None or not _due(tick, WORLD_STATES.rate) or not self._publisher.has_subscribers:
            return
        names = self._world.world_bodies
        states = [pose_and_twist(self._world.world_body_state(name)) for name in names]
        poses, twists = tuple(pose for pose, _ in states), tuple(twist for _, twist in states)
        header = Header(stamp=Time.of(now), frame_id="world")
        self._publisher.publish(WorldStates(header=header, name=names, pose=poses, twist=twists))


class GazeboStatesPublisher:
    """Models in the order of their spawning, each with its links from the root on; all in the world's axes.

    The world's movable and moving bodies follow as models, as in Gazebo.
    """

    def __init__(self, node: Node, world: World) -> None:
        self._world = world
        self._models: Publisher[Any] = node.advertise(MODEL_STATES)
        self._links: Publisher[Any] = node.advertise(LINK_STATES)

    def publish(self) -> None:
        """Publish them as they are now."""
        world = self._world
        if self._models.has_subscribers:
            states = [pose_and_twist(world.body(name).state()) for name in world.names]
            states += [pose_and_twist(world.world_body_state(name)) for name in world.world_bodies]
            poses, twists = tuple(pose for pose, _ in states), tuple(twist for _, twist in states)
            self._models.publish(ModelStates(name=(*world.names, *world.world_bodies), pose=poses, twist=twists))
        if self._links.has_subscribers:
            links = [(name, link) for name in world.names for link in world.body(name).links]
            states = [pose_and_twist(world.body(name).link_state(link)) for name, link in links]
            poses, twists = tuple(pose for pose, _ in states), tuple(twist for _, twist in states)
            self._links.publish(LinkStates(name=tuple(map("::".join, links)), pose=poses, twist=twists))
