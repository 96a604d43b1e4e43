"""Parses a URDF's ``<gazebo>`` tags: drive, sensors, friction and topics, in all common spellings.

Supported are the plugins of ROS 1 (``libgazebo_ros_…``, camelCase), those of ROS 2 (the same libraries, snake_case,
``<ros>``), and the corresponding systems of gz-sim. Other tags are listed with their line and ignored.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from models.model import CameraConfig, ImuConfig, LaserConfig, Mount
from models.urdf import MAX_VALUE, UrdfElement, parse_xml

MAX_SAMPLES = 10_000
"""Maximum number of rays of a laser."""
MAX_PIXELS = 320 * 240
"""Maximum number of pixels of a camera image: the software renderer takes 30 ms for it."""
MAX_CAMERA_RATE = 10.0
"""Maximum camera rate [Hz], for the same reason."""

_STEP_RATE = 200.0
"""Physics steps per second; every period is a whole number of steps."""
_LEAST_RATE = 1e-6
"""Minimum rate [Hz]: its period in steps is still a number."""
_TOPIC_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


@dataclass(frozen=True)
class DriveTag:
    """A drive: with wheels (``differential``, or ``steered`` like a car) or of the body itself (``holonomic``).

    Joints are in the order of the wheel pairs; ``reversed_joints`` turn backwards to drive ahead. Lengths in m,
    ``torque`` in N m, ``acceleration`` [m/s2] and the maxima [m/s, rad/s, rad] are None if no tag states them.
    """

    kind: Literal["differential", "steered", "holonomic"]
    where: str
    left_joints: tuple[str, ...] = ()
    right_joints: tuple[str, ...] = ()
    reversed_joints: tuple[str, ...] = ()
    separation: float | None = None
    radius: float | None = None
    torque: float | None = None
    acceleration: float | None = None
    max_linear: float | None = None
    max_angular: float | None = None
    max_steer: float | None = None


@dataclass(frozen=True)
class Transmission:
    """A ``<transmission>``, or a joint of ``<ros2_control>``: its joints and their command interfaces (``position``,
    ``velocity``, ``effort``, in the order of the file)."""

    name: str
    joints: tuple[str, ...]
    interfaces: tuple[str, ...]


@dataclass(frozen=True)
class RosControl:
    """The plugin that loads controllers: its ``parameters`` file as in the tag, empty if none, and its namespace."""

    parameters: str = ""
    namespace: str = ""


@dataclass(frozen=True)
class Friction:
    """The friction coefficients ``mu1`` and ``mu2`` of a link, None if not stated."""

    mu1: float | None = None
    mu2: float | None = None

    @property
    def coefficient(self) -> float | None:
        """The coefficient for the engine: the smaller of the two."""
        given = [each for each in (self.mu1, self.mu2) if each is not None]
        return min(given) if given else None


@dataclass(frozen=True)
class GazeboTags:
    """The supported content. ``topics`` maps our topic names to the tags'; ``odometry_rate`` and ``joint_rate`` in Hz.

    ``notes`` list what is simulated differently from its tag, ``ignored`` what is not simulated, each as ``file:line:
    <tag>: why``.
    """

    drive: DriveTag | None = None
    laser: LaserConfig | None = None
    imu: ImuConfig | None = None
    camera: CameraConfig | None = None
    odometry: Literal["world", "encoder"] | None = None
    odometry_rate: float | None = None
    joint_rate: float | None = None
    odom_tf: bool = True
    odom_frame: str = ""
    base_frame: str = ""
    static: bool = False
    topics: dict[str, str] = field(default_factory=dict)
    friction: dict[str, Friction] = field(default_factory=dict)
    transmissions: tuple[Transmission, ...] = ()
    ros_control: RosControl | None = None
    notes: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()


def parse_gazebo_tags(text: str, name: str = "robot.urdf") -> GazeboTags:
    """Parse the tags of a URDF; ``name`` is the file name used in notes."""
    robot = parse_xml(text)
    assert isinstance(robot, UrdfElement)
    return _Reader(name).read(robot)


def snake_case(name: str) -> str:
    """Convert a name to snake_case: ``wheelSeparation`` becomes ``wheel_separation``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def plugin_kind(plugin: UrdfElement) -> str:
    """Return the kind of a plugin, from its library or the class of a gz-sim system: ``gazebo_ros_diff_drive``."""
    for name in (plugin.get("name", ""), plugin.get("filename", "")):
        if "::" in name:
            return "gz_" + snake_case(name.rpartition("::")[2])
    library = plugin.get("filename", "").rpartition("/")[2]
    library = re.sub(r"\.so[.\d]*$", "", library).removeprefix("lib")
    system = re.fullmatch(r"(?:gz|ignition)-(?:sim|gazebo)\d*-(.+)-system", library)
    return f"gz_{system[1]}".replace("-", "_") if system else snake_case(library)


_PLUGIN_ALIASES = {
    "gazebo_ros_gpu_laser": "gazebo_ros_laser",
    "gazebo_ros_block_laser": "gazebo_ros_laser",
    "gazebo_ros_ray_sensor": "gazebo_ros_laser",
    "gazebo_ros_imu_sensor": "gazebo_ros_imu",
    "hector_gazebo_ros_imu": "gazebo_ros_imu",
    "gazebo_ros_depth_camera": "gazebo_ros_camera",
    "gazebo_ros_openni_kinect": "gazebo_ros_camera",
}
"""Plugins that are parsed like another one."""

_NEEDED_BY_GZ = {
    f"gz_{each}"
    for each in ("physics", "sensors", "imu", "scene_broadcaster", "user_commands", "contact", "pose_publisher")
}
"""Systems that gz-sim worlds need for what this simulation always does."""

_QUIET = {
    "always_on",
    "ros_debug_level",
    "debug",
    "robot_namespace",
    "namespace",
    "ros",
    "publish_wheel_tf",
    "publish_wheel_joint_state",
    "publish_odom",
    "publish_odom_tf",
    "publish_tf",
    "num_wheel_pairs",
    "legacy_mode",
    "legacy_mode_ns",
    "robot_sim_type",
    "tf_prefix",
    "covariance_x",
    "covariance_y",
    "covariance_yaw",
    "initial_orientation_as_reference",
    "visualize",
    "output_type",
    "tf_topic",
    "service_name",
    "joint_name",
    "update_rate_hz",
    "cmd_timeout",
    "cmd_vel_timeout",
}
"""Plugin parameters that have no effect on what is simulated here."""

_CONTACT_TAGS = {
    "kp",
    "kd",
    "max_vel",
    "min_depth",
    "max_contacts",
    "fdir1",
    "soft_cfm",
    "soft_erp",
    "laser_retro",
    "damping_factor",
    "implicit_spring_damper",
    "stop_cfm",
    "stop_erp",
    "stop_kp",
    "stop_kd",
    "fudge_factor",
    "cfm_damping",
    "slip1",
    "slip2",
}
"""Settings of Gazebo's solver."""

_LOOKS = {"material", "visual", "transparency", "cast_shadows"}
"""Appearance in Gazebo only: here the URDF's own ``<material>`` is used."""

_UNNEEDED = {
    "preserve_fixed_joint",
    "disable_fixed_joint_lumping",
    "provide_feedback",
    "pose",
    "enable_wind",
    "allow_auto_disable",
    "self_collide",
    "gravity",
    "turn_gravity_off",
}

_SENSOR_KINDS = {
    "ray": "laser",
    "gpu_ray": "laser",
    "lidar": "laser",
    "gpu_lidar": "laser",
    "imu": "imu",
    "camera": "camera",
    "depth": "camera",
    "depth_camera": "camera",
    "rgbd_camera": "camera",
    "rgbd": "camera",
}


class _Reader:
    """Collects the tags of one URDF."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._found: dict[str, object] = {}
        self._topics: dict[str, str] = {}
        self._friction: dict[str, Friction] = {}
        self._notes: list[str] = []
        self._ignored: dict[str, str] = {}
        self._plugins: dict[str, Callable[[UrdfElement, str], None]] = {
            "gazebo_ros_diff_drive": self._diff_drive,
            "gazebo_ros_skid_steer_drive": self._skid_steer,
            "gazebo_ros_planar_move": self._planar_move,
            "gazebo_ros_force_based_move": self._force_based_move,
            "gazebo_ros_kobuki": self._kobuki,
            "steered_drive": self._steered_drive,
            "gazebo_ros_joint_state_publisher": self._joint_states,
            "gazebo_ros_p3d": self._ground_truth,
            "gazebo_ros_control": self._ros_control,
            "gazebo_ros_imu": self._imu_plugin,
            "gz_diff_drive": self._gz_diff_drive,
            "gz_mecanum_drive": self._gz_mecanum,
            "gz_joint_state_publisher": self._joint_states,
            "gz_odometry_publisher": self._gz_odometry,
        }

    def read(self, robot: UrdfElement) -> GazeboTags:
        for tag in _children(robot, "gazebo"):
            self._gazebo(tag)
        transmissions = (*self._transmissions(robot), *self._ros2_control(robot))
        return GazeboTags(
            topics=self._topics,
            friction=self._friction,
            transmissions=transmissions,
            notes=tuple(self._notes),
            ignored=tuple(self._ignored.values()),
            **self._found,  # type: ignore[arg-type]
        )

    def _gazebo(self, tag: UrdfElement) -> None:
        link = tag.get("reference", "")
        for each in _children(tag):
            kind = snake_case(each.tag)
            if kind == "plugin":
                self._plugin(each, link)
            elif kind == "sensor":
                self._sensor(each, link)
            elif kind in ("mu1", "mu2", "mu"):
                self._mu(link, each)
            elif kind == "collision":
                for name in ("mu", "mu2"):
                    for mu in _elements(each, f".//friction//{name}"):
                        self._mu(link, mu)
            elif kind == "static":
                self._found["static"] = _flag(each)
            elif kind == "self_collide" and _flag(each):
                self._ignore(each, "the links of a robot pass through each other")
            elif kind in ("turn_gravity_off", "gravity") and _flag(each) == (kind == "turn_gravity_off"):
                self._ignore(each, "gravity acts on every link")
            elif kind in _CONTACT_TAGS:
                self._ignore(each, "settings of Gazebo's solver: contacts are rigid here", key="solver")
            elif kind not in _LOOKS | _UNNEEDED:
                self._ignore(each, "not understood")

    def _plugin(self, plugin: UrdfElement, link: str) -> None:
        kind = plugin_kind(plugin)
        kind = _PLUGIN_ALIASES.get(kind, kind)
        if re.search("ro_?s_?2?_control", kind):
            kind = "gazebo_ros_control"
        elif "ackerman" in kind or "tricycle" in kind:
            # Spelled both ways; robot manufacturers have their own variants.
            kind = "steered_drive"
        elif kind.endswith("_force_based_move"):
            # Robot manufacturers have their own variants, e.g. ridgeback_ros_force_based_move.
            kind = "gazebo_ros_force_based_move"
        read = self._plugins.get(kind)
        if read is not None:
            read(plugin, link)
        elif kind not in _NEEDED_BY_GZ:
            name = plugin.get("filename") or plugin.get("name", "")
            self._ignore(plugin, f"this plugin is not simulated: {str(name)[:100]}", key=f"plugin {name}")

    # Drives

    def _diff_drive(self, plugin: UrdfElement, _: str) -> None:
        self._wheel_drive(plugin, self._joints(plugin, "left_joint"), self._joints(plugin, "right_joint"))
        sources = {"0": "encoder", "1": "world", "encoder": "encoder", "world": "world"}
        # The default of the plugin is the true pose.
        self._found["odometry"] = sources.get(self._text(plugin, "odometry_source"), "world")
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _skid_steer(self, plugin: UrdfElement, _: str) -> None:
        left, right = (self._joints(plugin, f"{side}_front_joint", f"{side}_rear_joint") for side in ("left", "right"))
        self._wheel_drive(plugin, left, right)
        # The plugin publishes the true pose.
        self._found["odometry"] = "world"
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _wheel_drive(self, plugin: UrdfElement, left: tuple[str, ...], right: tuple[str, ...]) -> None:
        """Read the differential drive of a Gazebo Classic plugin."""
        diameter = self._number(plugin, "wheel_diameter")
        self._add_drive(
            DriveTag(
                "differential",
                self._where(plugin),
                left,
                right,
                separation=self._number(plugin, "wheel_separation"),
                radius=diameter and diameter / 2,
                torque=self._number(plugin, "max_wheel_torque", "wheel_torque", "torque"),
                acceleration=self._number(plugin, "max_wheel_acceleration", "wheel_acceleration"),
            ),
            plugin,
        )

    def _planar_move(self, plugin: UrdfElement, _: str) -> None:
        self._add_drive(DriveTag("holonomic", self._where(plugin)), plugin)
        self._found["odometry"] = "world"
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _force_based_move(self, plugin: UrdfElement, _: str) -> None:
        """Read a force on the body that tracks the commanded velocity: a mecanum base; with a zero gain for y, another
        base, which is driven by its wheels here."""
        self._mark_read(plugin, "x_velocity_p_gain", "yaw_velocity_p_gain", "command_watchdog", "cmd_vel_time_out")
        if self._number(plugin, "y_velocity_p_gain") != 0:
            self._add_drive(
                DriveTag(
                    "holonomic",
                    self._where(plugin),
                    max_linear=self._number(plugin, "max_x_velocity"),
                    max_angular=self._number(plugin, "max_yaw_velocity"),
                ),
                plugin,
            )
            self._mark_read(plugin, "max_y_velocity")
        self._found["odometry"] = "world"
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _kobuki(self, plugin: UrdfElement, _: str) -> None:
        """Read the base of the TurtleBot 2, whose topics are below ``mobile_base``."""
        diameter = self._number(plugin, "wheel_diameter")
        self._add_drive(
            DriveTag(
                "differential",
                self._where(plugin),
                self._joints(plugin, "left_wheel_joint_name"),
                self._joints(plugin, "right_wheel_joint_name"),
                separation=self._number(plugin, "wheel_separation"),
                radius=diameter and diameter / 2,
                torque=self._number(plugin, "torque"),
            ),
            plugin,
        )
        if self._text(plugin, "publish_tf") in ("false", "0"):
            self._found["odom_tf"] = False
        self._alias("cmd_vel", "mobile_base/commands/velocity")
        if self._text(plugin, "imu_name"):
            self._alias("imu", "mobile_base/sensors/imu_data")
        self._mark_read(plugin, "velocity_command_timeout")
        self._ignore_unread(plugin)

    def _steered_drive(self, plugin: UrdfElement, _: str) -> None:
        """Read the drive of a car or tricycle, whose wheels are found by their joints."""
        diameter = self._number(plugin, "wheel_diameter", "actuated_wheel_diameter")
        self._add_drive(
            DriveTag(
                "steered",
                self._where(plugin),
                separation=self._number(plugin, "wheel_separation"),
                radius=diameter / 2 if diameter else self._number(plugin, "wheel_radius"),
                max_linear=self._number(plugin, "max_speed", "max_velocity", "max_linear_velocity"),
                max_angular=self._number(plugin, "max_angular_velocity"),
                max_steer=self._number(plugin, "max_steer", "steering_limit"),
                torque=self._number(plugin, "torque", "wheel_torque"),
            ),
            plugin,
        )
        for each in _children(plugin):
            if "joint" in each.tag.lower():
                each.set("read", "")
        self._mark_read(plugin, "wheel_base", "kingpin_width", "min_velocity", "min_linear_velocity")
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _gz_diff_drive(self, plugin: UrdfElement, _: str) -> None:
        self._add_drive(
            DriveTag(
                "differential",
                self._where(plugin),
                self._joints(plugin, "left_joint"),
                self._joints(plugin, "right_joint"),
                separation=self._number(plugin, "wheel_separation"),
                radius=self._number(plugin, "wheel_radius"),
                acceleration=self._number(plugin, "max_linear_acceleration", "max_acceleration"),
                max_linear=self._number(plugin, "max_linear_velocity", "max_velocity"),
                max_angular=self._number(plugin, "max_angular_velocity"),
            ),
            plugin,
        )
        self._mark_read(plugin, "min_linear_velocity", "min_angular_velocity", "min_velocity")
        self._mark_read(plugin, "min_linear_acceleration", "min_angular_acceleration", "max_angular_acceleration")
        self._mark_read(plugin, "min_acceleration", "min_jerk", "max_jerk")
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _gz_mecanum(self, plugin: UrdfElement, _: str) -> None:
        self._mark_read(plugin, "front_left_joint", "front_right_joint", "back_left_joint", "back_right_joint")
        self._mark_read(plugin, "wheel_separation", "wheelbase", "wheel_radius", "min_velocity", "min_acceleration")
        self._add_drive(
            DriveTag(
                "holonomic",
                self._where(plugin),
                acceleration=self._number(plugin, "max_acceleration", "max_linear_acceleration"),
                max_linear=self._number(plugin, "max_velocity", "max_linear_velocity"),
                max_angular=self._number(plugin, "max_angular_velocity"),
            ),
            plugin,
        )
        self._notes.append(
            f"{self._where(plugin)}: <plugin>: the body moves as commanded; the rollers of mecanum wheels are not "
            "simulated"
        )
        self._odometry(plugin)
        self._ignore_unread(plugin)

    def _add_drive(self, drive: DriveTag, plugin: UrdfElement) -> None:
        if "drive" in self._found:
            self._ignore(plugin, "a second drive: only the first one is used", key="second drive")
        elif drive.kind == "differential" and not (drive.left_joints and drive.right_joints):
            self._ignore(plugin, "a drive without left and right joints drives nothing", key="drive")
        else:
            self._found["drive"] = drive

    def _odometry(self, plugin: UrdfElement) -> None:
        self._topic("cmd_vel", plugin, "command_topic", "topic", remapped="cmd_vel")
        self._topic("odom", plugin, "odometry_topic", "odom_topic", remapped="odom")
        rate = self._number(plugin, "odometry_rate", "odom_publish_frequency", "update_rate")
        if rate is not None and rate > 0:
            self._found["odometry_rate"] = min(rate, 50.0)
        frame = self._text(plugin, "odometry_frame", "odom_frame", "frame_id")
        if frame:
            self._found["odom_frame"] = _bare(frame)
        base = self._text(plugin, "robot_base_frame", "child_frame_id")
        if base:
            self._found["base_frame"] = _bare(base)
        if self._text(plugin, "publish_odom_tf", "publish_odometry_tf", "publish_tf", "broadcast_tf") in ("false", "0"):
            self._found["odom_tf"] = False

    def _gz_odometry(self, plugin: UrdfElement, _: str) -> None:
        self._found.setdefault("odometry", "world")
        self._mark_read(plugin, "dimensions", "odom_covariance_topic", "gaussian_noise", "xyz_offset", "rpy_offset")
        self._odometry(plugin)
        self._ignore_unread(plugin)

    # Other plugins of a model

    def _joint_states(self, plugin: UrdfElement, _: str) -> None:
        rate = self._number(plugin, "update_rate")
        if rate is not None and rate > 0:
            self._found["joint_rate"] = step_rate(rate, 1)
        self._topic("joint_states", plugin, "topic_name", "topic", remapped="joint_states")
        self._mark_read(plugin, "joint_name")
        self._ignore_unread(plugin)

    def _ground_truth(self, plugin: UrdfElement, _: str) -> None:
        self._topic("ground_truth", plugin, "topic_name", remapped="odom")
        self._mark_read(plugin, "body_name", "frame_name", "update_rate", "xyz_offset", "rpy_offset")
        self._mark_read(plugin, "xyz_offsets", "rpy_offsets")
        noise = self._number(plugin, "gaussian_noise")
        if noise:
            self._note(plugin, "ground_truth is exact, its gaussianNoise is not added")
        self._ignore_unread(plugin)

    def _ros_control(self, plugin: UrdfElement, _: str) -> None:
        self._found.setdefault(
            "ros_control",
            RosControl(self._text(plugin, "parameters"), self._text(plugin, "robot_namespace").strip("/")),
        )

    # Sensors

    def _sensor(self, sensor: UrdfElement, link: str) -> None:
        kind = _SENSOR_KINDS.get(sensor.get("type", ""))
        if not link:
            self._ignore(sensor, "a sensor outside of <gazebo reference=...> belongs to no link")
        elif kind is None:
            self._ignore(sensor, f"no sensor of the type {sensor.get('type', '')!r} is simulated")
        elif kind in self._found:
            self._ignore(sensor, f"a robot has one {kind}: only the first one is used", key=f"second {kind}")
        else:
            plugin = sensor.find("plugin")
            mount = Mount(
                **_pose(self._vector(sensor, "pose", 6)),
                frame=_bare(
                    self._text(sensor, "gz_frame_id", "ignition_frame_id", "frame_id")
                    or (self._text(plugin, "frame_name", "frame_id") if isinstance(plugin, UrdfElement) else "")
                ),
            )
            read = {"laser": self._laser, "imu": self._imu, "camera": self._camera}[kind]
            read(sensor, plugin if isinstance(plugin, UrdfElement) else None, link, mount)

    def _laser(self, sensor: UrdfElement, plugin: UrdfElement | None, link: str, mount: Mount) -> None:
        publisher = "" if plugin is None else plugin_kind(plugin)
        if re.search("range|sonar|bumper", publisher) or not (publisher or self._text(sensor, "topic")):
            self._ignore(sensor, "a ray sensor without a laser plugin is not simulated", key="rays")
            return
        ray = next((each for name in ("ray", "lidar") if (each := sensor.find(name)) is not None), None)
        flat = ray.find("scan/horizontal") if ray is not None else None
        if not isinstance(ray, UrdfElement) or not isinstance(flat, UrdfElement):
            self._ignore(sensor, "a laser without <ray><scan><horizontal> has no rays")
            return
        vertical = ray.find("scan/vertical")
        if isinstance(vertical, UrdfElement) and (self._number(vertical, "samples") or 1) > 1:
            self._note(vertical, "a laser scans one plane, the horizontal one")
        samples = int(self._number(flat, "samples") or 640)
        low, high = self._number(flat, "min_angle") or 0.0, self._number(flat, "max_angle") or 0.0
        samples = max(1, min(samples, MAX_SAMPLES))
        full_turn = high - low >= math.tau * (1 - 1.5 / max(samples, 2)) or samples < 2 or high <= low
        if samples > 1 and high <= low:
            self._note(flat, f"min_angle {low:g} is not below max_angle {high:g}: the laser looks all around")
        near, far = self._range(ray)
        rate = self._rate(sensor, plugin, 10.0)
        stated = self._noise(ray, "noise")
        self._found["laser"] = LaserConfig(
            link=link,
            rate=step_rate(rate, 2),
            samples=samples,
            range_min=near,
            range_max=far,
            noise=0.0 if stated is None else stated,
            clearance=near,
            angle_min=low,
            angle_max=None if full_turn else high,
            mount=mount,
        )
        self._note_rate(sensor, rate, step_rate(rate, 2))
        self._sensor_topic("scan", sensor, plugin)

    def _range(self, ray: UrdfElement) -> tuple[float, float]:
        limits = ray.find("range")
        near = far = None
        if isinstance(limits, UrdfElement):
            near, far = self._number(limits, "min"), self._number(limits, "max")
        near = max(near or 0.0, 0.001)
        return near, max(far if far is not None and far < MAX_VALUE else 100.0, 2 * near)

    def _imu(self, sensor: UrdfElement, plugin: UrdfElement | None, link: str, mount: Mount) -> None:
        both = self._number(plugin, "gaussian_noise") if plugin is not None else None
        gyro = self._noise(sensor, ".//angular_velocity/x/noise", ".//noise/rate")
        accel = self._noise(sensor, ".//linear_acceleration/x/noise", ".//noise/accel")
        rate = self._rate(sensor, plugin, 100.0)
        self._found["imu"] = ImuConfig(
            link=link,
            rate=step_rate(rate, 2),
            gyro_noise=gyro if gyro is not None else both or 0.0,
            acceleration_noise=accel if accel is not None else both or 0.0,
            mount=mount,
        )
        self._note_rate(sensor, rate, step_rate(rate, 2))
        self._sensor_topic("imu", sensor, plugin)

    def _imu_plugin(self, plugin: UrdfElement, link: str) -> None:
        """Read an IMU that is a plugin of the model, on the link ``bodyName``."""
        body = self._text(plugin, "body_name") or link
        if not body or "imu" in self._found:
            self._ignore(plugin, "a robot has one imu: only the first one is used" if body else "it names no bodyName")
            return
        rate = self._rate(plugin, None, 100.0)
        noise = self._number(plugin, "gaussian_noise")
        accel, gyro = self._vector(plugin, "accel_gaussian_noise", 3), self._vector(plugin, "rate_gaussian_noise", 3)
        self._found["imu"] = ImuConfig(
            link=body,
            rate=step_rate(rate, 2),
            gyro_noise=abs(gyro[0]) if gyro else abs(noise or 0.0),
            acceleration_noise=abs(accel[0]) if accel else abs(noise or 0.0),
            mount=Mount(frame=_bare(self._text(plugin, "frame_name", "frame_id"))),
        )
        self._note_rate(plugin, rate, step_rate(rate, 2))
        self._topic("imu", plugin, "topic_name", remapped="~/out")

    def _camera(self, sensor: UrdfElement, plugin: UrdfElement | None, link: str, mount: Mount) -> None:
        camera = sensor.find("camera")
        image = camera.find("image") if camera is not None else None
        clip = camera.find("clip") if camera is not None else None
        size = [self._number(image, each) if image is not None else None for each in ("width", "height")]
        width, height = (max(1, int(each or default)) for each, default in zip(size, (320, 240), strict=True))
        shrink = max(1.0, math.sqrt(width * height / MAX_PIXELS))
        wide, high = max(1, round(width / shrink)), max(1, round(height / shrink))
        rate = self._rate(sensor, plugin, 10.0)
        fov = self._number(camera, "horizontal_fov") if camera is not None else None
        near = self._number(clip, "near") if clip is not None else None
        far = self._number(clip, "far") if clip is not None else None
        near = max(near or 0.05, 1e-3)
        self._found["camera"] = CameraConfig(
            link=link,
            rate=step_rate(min(rate, MAX_CAMERA_RATE), 2),
            width=wide,
            height=high,
            fov=min(fov, 3.1) if fov is not None and fov > 0 else 1.047,
            near=near,
            far=max(min(far or 100.0, 1000.0), 2 * near),
            optical=False,
            mount=mount,
        )
        if (wide, high) != (width, height) or rate > MAX_CAMERA_RATE:
            self._note(
                sensor,
                f"{width} x {height} pixels at {rate:g} Hz are reduced to {wide} x {high} at "
                f"{min(rate, MAX_CAMERA_RATE):g} Hz: images are rendered in software",
            )
        if _SENSOR_KINDS.get(sensor.get("type", "")) == "camera" and sensor.get("type") != "camera":
            self._note(sensor, "only the colour image of a depth camera is simulated")
        self._camera_topics(sensor, plugin)

    def _camera_topics(self, sensor: UrdfElement, plugin: UrdfElement | None) -> None:
        base = ""
        if plugin is not None:
            base = _bare(self._text(plugin, "camera_name"))
            image, info = self._text(plugin, "image_topic_name"), self._text(plugin, "camera_info_topic_name")
            if not base and plugin_kind(plugin).startswith("gazebo_ros"):
                base = sensor.get("name", "")
            if base:
                self._alias("camera/image", image if image.startswith("/") else f"{base}/{image or 'image_raw'}")
                self._alias("camera/camera_info", info if info.startswith("/") else f"{base}/{info or 'camera_info'}")
            remaps = dict(_remaps(plugin))
            for source, topic in remaps.items():
                if source.endswith("image_raw"):
                    self._alias("camera/image", topic)
                elif source.endswith("camera_info"):
                    self._alias("camera/camera_info", topic)
        topic = self._text(sensor, "topic")
        if topic and not base:
            self._alias("camera/image", topic)

    def _rate(self, sensor: UrdfElement, plugin: UrdfElement | None, default: float) -> float:
        rate = self._number(sensor, "update_rate")
        if not rate and plugin is not None:
            rate = self._number(plugin, "update_rate")
        return rate if rate is not None and rate > 0 else default

    def _noise(self, element: UrdfElement, *paths: str) -> float | None:
        """Return the standard deviation of the Gaussian noise at the first existing path."""
        for noise in (each for path in paths for each in _elements(element, path)):
            deviation = self._number(noise, "stddev")
            return None if deviation is None else abs(deviation)
        return None

    def _sensor_topic(self, ours: str, sensor: UrdfElement, plugin: UrdfElement | None) -> None:
        topic = self._text(sensor, "topic")
        if topic:
            self._alias(ours, topic)
        if plugin is not None:
            kind = plugin_kind(plugin)
            if _PLUGIN_ALIASES.get(kind, kind) not in ("gazebo_ros_laser", "gazebo_ros_imu"):
                self._note(plugin, f"{plugin.get('filename', '')[:100]} is not known; its sensor is simulated")
            self._topic(ours, plugin, "topic_name", remapped="~/out")

    # Pieces

    def _mu(self, link: str, element: UrdfElement) -> None:
        value = self._value(element)
        if value is None or not link:
            self._ignore(element, "friction needs a number and a link: <gazebo reference=...>")
            return
        before = self._friction.get(link, Friction())
        mu1, mu2 = (before.mu1, value) if element.tag == "mu2" else (value, before.mu2)
        self._friction[link] = Friction(None if mu1 is None else max(0.0, mu1), None if mu2 is None else max(0.0, mu2))

    def _transmissions(self, robot: UrdfElement) -> Iterator[Transmission]:
        for each in _children(robot, "transmission"):
            joints, interfaces = [], []
            for joint in _children(each, "joint"):
                joints.append(joint.get("name", ""))
                interfaces += [(tag.text or "").strip() for tag in _elements(joint, ".//hardwareInterface")]
            for actuator in _children(each, "actuator"):
                interfaces += [(tag.text or "").strip() for tag in _elements(actuator, ".//hardwareInterface")]
            if joints:
                yield Transmission(each.get("name", ""), tuple(joints), tuple(dict.fromkeys(_interfaces(interfaces))))

    def _ros2_control(self, robot: UrdfElement) -> Iterator[Transmission]:
        for system in _children(robot, "ros2_control"):
            for joint in _children(system, "joint"):
                names = [tag.get("name", "") for tag in _children(joint, "command_interface")]
                yield Transmission(joint.get("name", ""), (joint.get("name", ""),), tuple(_interfaces(names)))

    def _topic(self, ours: str, plugin: UrdfElement, *names: str, remapped: str) -> None:
        name = self._text(plugin, *names)
        for source, topic in _remaps(plugin):
            if source in (remapped, ours, f"~/{ours}"):
                name = topic
        if name:
            self._alias(ours, name)

    def _alias(self, ours: str, topic: str) -> None:
        topic = re.sub("/+", "/", topic.strip().removeprefix("~")).strip("/")
        if topic != ours and not topic.startswith("__") and _TOPIC_NAME.fullmatch(topic):
            self._topics[ours] = topic

    def _joints(self, plugin: UrdfElement, *names: str) -> tuple[str, ...]:
        return tuple((each.text or "").strip() for name in names for each in _named(plugin, name) if each.text)

    def _mark_read(self, plugin: UrdfElement, *names: str) -> None:
        """Mark parameters as known that have no effect here."""
        for name in names:
            for each in _named(plugin, name):
                each.set("read", "")

    def _text(self, element: UrdfElement | None, *names: str) -> str:
        """Return the text of the first child with one of these names, in either spelling; empty if there is none."""
        if element is None:
            return ""
        found = [(each.text or "").strip() for name in names for each in _named(element, name)]
        return found[0] if found else ""

    def _number(self, element: object, *names: str) -> float | None:
        """Return the number of the first child with one of these names; an invalid one is listed and ignored."""
        assert isinstance(element, UrdfElement)
        found = [each for name in names for each in _named(element, name)]
        return self._value(found[0]) if found else None

    def _value(self, element: UrdfElement) -> float | None:
        text = (element.text or "").strip() or element.get("value", "")
        try:
            value = float(text.split()[0])
        except (ValueError, IndexError):
            value = math.nan
        if abs(value) <= MAX_VALUE * 1e6:
            return value
        self._ignore(element, f"{text[:60]!r} is not a number", key=f"{element.tag} {element.line}")
        return None

    def _vector(self, element: UrdfElement, name: str, count: int) -> tuple[float, ...]:
        text = self._text(element, name)
        try:
            values = tuple(float(each) for each in text.split())
        except ValueError:
            values = ()
        return values if len(values) == count and all(abs(each) <= MAX_VALUE for each in values) else ()

    def _ignore_unread(self, plugin: UrdfElement) -> None:
        """List the parameters of a plugin that were not read."""
        for each in _children(plugin):
            if "read" not in each.attrib and snake_case(each.tag) not in _QUIET:
                self._ignore(each, f"this parameter of {plugin_kind(plugin)} has no effect here")

    def _note_rate(self, element: UrdfElement, stated: float, rate: float) -> None:
        if abs(stated - rate) > 0.01 * stated:
            self._note(element, f"{stated:g} Hz is {rate:.3g} Hz here: periods are whole physics steps of 5 ms")

    def _note(self, element: UrdfElement, text: str) -> None:
        self._notes.append(f"{self._where(element)}: <{element.tag}>: {text}")

    def _ignore(self, element: UrdfElement, why: str, key: str = "") -> None:
        self._ignored.setdefault(key or f"{element.tag} {why}", f"{self._where(element)}: <{element.tag}>: {why}")

    def _where(self, element: UrdfElement) -> str:
        return f"{self._name}:{element.line}"


def step_rate(rate: float, steps: int) -> float:
    """Return the highest rate [Hz] up to ``rate`` whose period is a multiple of ``steps`` physics steps."""
    return _STEP_RATE / (steps * max(1, math.ceil(_STEP_RATE / steps / max(rate, _LEAST_RATE) - 1e-9)))


def _children(element: object, tag: str = "") -> list[UrdfElement]:
    assert isinstance(element, UrdfElement)
    return [each for each in element if isinstance(each, UrdfElement) and (not tag or each.tag == tag)]


def _elements(element: UrdfElement, path: str) -> list[UrdfElement]:
    return [each for each in element.iterfind(path) if isinstance(each, UrdfElement)]


def _named(element: UrdfElement, name: str) -> list[UrdfElement]:
    """Return the children with this name in either spelling, and mark them as read."""
    found = [each for each in _children(element) if snake_case(each.tag) == name]
    for each in found:
        each.set("read", "")
    return found


def _remaps(plugin: UrdfElement) -> Iterator[tuple[str, str]]:
    """Yield the remappings of a ROS 2 plugin, and of gz-sim's bridge."""
    for tag in ("remapping", "argument"):
        for each in _elements(plugin, f"ros/{tag}"):
            source, found, topic = (each.text or "").partition(":=")
            if found:
                yield source.strip(), topic.strip()


def _interfaces(names: Iterable[str]) -> Iterator[str]:
    """Normalize interface names: ``hardware_interface/VelocityJointInterface`` becomes ``velocity``."""
    for name in names:
        plain = name.rpartition("/")[2].removesuffix("JointInterface").lower()
        if plain:
            yield plain


def _flag(element: UrdfElement) -> bool:
    return ((element.text or "").strip() or element.get("value", "")).lower() in ("true", "1")


def _bare(frame: str) -> str:
    """Return a frame without its leading slash."""
    return frame.strip().strip("/")


def _pose(six: tuple[float, ...]) -> dict[str, tuple[float, float, float]]:
    return {"xyz": (six[0], six[1], six[2]), "rpy": (six[3], six[4], six[5])} if six else {}
