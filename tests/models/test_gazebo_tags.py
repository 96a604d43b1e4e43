"""Parsing of Gazebo's tags in the forms of ROS 1, ROS 2 and gz-sim, and notes about unsupported ones."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from models.gazebo_tags import DriveTag, GazeboTags, Transmission, parse_gazebo_tags, step_rate
from models.model import LaserConfig, Mount

ROBOTS = Path(__file__).parent / "robots"


def tags_of(*inside: str) -> GazeboTags:
    """Return the tags of a robot with one of these elements per line, from line 2 on."""
    return parse_gazebo_tags("\n".join(("<robot name='r'>", *inside, "</robot>")), "r.urdf")


def drive_of(*inside: str) -> DriveTag:
    drive = tags_of(*inside).drive
    assert drive is not None
    return drive


def test_the_courier_of_ros_1_is_understood_whole() -> None:
    tags = parse_gazebo_tags((ROBOTS / "courier.urdf").read_text(), "courier.urdf")
    assert tags.drive == DriveTag(
        "differential",
        "courier.urdf:88",
        ("left_wheel_joint",),
        ("right_wheel_joint",),
        separation=0.30,
        radius=0.06,
        torque=3.0,
        acceleration=1.2,
    )
    assert (tags.odometry, tags.odometry_rate, tags.joint_rate) == ("encoder", 40.0, 20.0)
    assert (tags.odom_frame, tags.base_frame) == ("odom_wheels", "base_link")
    assert tags.laser == LaserConfig(
        link="lidar_link",
        rate=10.0,
        samples=181,
        range_min=0.1,
        range_max=8.0,
        noise=0.02,
        clearance=0.1,
        angle_min=-1.5708,
        angle_max=1.5708,
        mount=Mount(frame="lidar_link"),
    )
    assert tags.imu is not None
    assert (tags.imu.link, tags.imu.rate, tags.imu.gyro_noise) == ("imu_link", 50.0, 0.001)
    assert tags.topics == {
        "cmd_vel": "courier/cmd_vel",
        "odom": "wheel_odom",
        "ground_truth": "pose_truth",
        "scan": "laser/scan",
        "imu": "imu/data",
    }
    assert {link: each.coefficient for link, each in tags.friction.items()} == {"left_wheel": 1.0, "right_wheel": 1.0}
    assert [each.split(": ")[1] for each in tags.ignored] == ["<kp>", "<blinkingLights>", "<plugin>"]
    assert "courier.urdf:84: <kp>: settings of Gazebo" in tags.ignored[0], "named once, where it comes first"


def test_a_drive_of_wheel_pairs_in_ros_2() -> None:
    tags = parse_gazebo_tags((ROBOTS / "ranger.urdf").read_text(), "ranger.urdf")
    assert tags.drive is not None
    assert tags.drive.left_joints == ("front_left_joint", "rear_left_joint")
    assert tags.drive.right_joints == ("front_right_joint", "rear_right_joint")
    assert (tags.drive.separation, tags.drive.radius, tags.drive.torque) == (0.48, 0.1, 20.0)
    assert tags.topics == {"cmd_vel": "base/cmd_vel", "odom": "base/odom"}
    assert not tags.odom_tf
    assert tags.ignored == ()


def test_odometry_is_the_true_pose_unless_the_plugin_counts_wheels() -> None:
    drive = "<left_joint>l</left_joint><right_joint>r</right_joint>{}</plugin></gazebo>"
    classic = '<gazebo><plugin name="d" filename="libgazebo_ros_diff_drive.so">'
    cases = {"": "world", "world": "world", "1": "world", "2": "world", "encoder": "encoder", "0": "encoder"}
    for stated, expected in cases.items():
        for name in ("odometrySource", "odometry_source"):
            tag = f"<{name}>{stated}</{name}>" if stated else ""
            assert tags_of(classic + drive.format(tag)).odometry == expected
    gz = '<gazebo><plugin name="gz::sim::systems::DiffDrive" filename="gz-sim-diff-drive-system">'
    assert tags_of(gz + drive.format("")).odometry is None


def test_drives_by_their_other_names() -> None:
    skid = drive_of(
        '<gazebo><plugin name="s" filename="libgazebo_ros_skid_steer_drive.so">',
        "<leftFrontJoint>lf</leftFrontJoint><leftRearJoint>lr</leftRearJoint>",
        "<rightFrontJoint>rf</rightFrontJoint><rightRearJoint>rr</rightRearJoint>",
        "<wheelSeparation>0.4</wheelSeparation><wheelDiameter>0.2</wheelDiameter><torque>20</torque>",
        "</plugin></gazebo>",
    )
    assert (skid.left_joints, skid.right_joints) == (("lf", "lr"), ("rf", "rr"))
    assert (skid.separation, skid.radius, skid.torque) == (0.4, 0.1, 20.0)
    for name, file in (
        ("gz::sim::systems::DiffDrive", "gz-sim-diff-drive-system"),
        ("ignition::gazebo::systems::DiffDrive", "libignition-gazebo-diff-drive-system.so"),
        ("plain", "libignition-gazebo6-diff-drive-system.so"),
    ):
        gz = drive_of(
            f'<gazebo><plugin name="{name}" filename="{file}"><left_joint>l</left_joint><right_joint>r</right_joint>',
            "<wheel_separation>0.3</wheel_separation><wheel_radius>0.05</wheel_radius>",
            "<max_linear_acceleration>0.7</max_linear_acceleration><max_linear_velocity>0.6</max_linear_velocity>",
            "<topic>cmd_vel</topic></plugin></gazebo>",
        )
        assert (gz.left_joints, gz.radius, gz.acceleration, gz.max_linear) == (("l",), 0.05, 0.7, 0.6)
    planar = '<gazebo><plugin name="p" filename="libgazebo_ros_planar_move.so"/></gazebo>'
    assert drive_of(planar).kind == "holonomic"
    mecanum = '<gazebo><plugin name="gz::sim::systems::MecanumDrive" filename="x"/></gazebo>'
    assert drive_of(mecanum).kind == "holonomic"
    assert "rollers" in tags_of(mecanum).notes[0]


def test_a_body_that_a_force_moves() -> None:
    tag = (
        '<gazebo><plugin name="m" filename="libmaker_ros_force_based_move.so"><commandTopic>base/cmd_vel</commandTopic>'
        "<odometryTopic>odom</odometryTopic><publishOdometryTf>0</publishOdometryTf><cmdVelTimeOut>0.25</cmdVelTimeOut>"
        "<yaw_velocity_p_gain>500</yaw_velocity_p_gain><x_velocity_p_gain>1e4</x_velocity_p_gain>"
        "<y_velocity_p_gain>1e4</y_velocity_p_gain><max_x_velocity>0.8</max_x_velocity>"
        "<max_y_velocity>0.8</max_y_velocity><max_yaw_velocity>1.5</max_yaw_velocity></plugin></gazebo>"
    )
    tags = tags_of(tag)
    assert tags.drive == DriveTag("holonomic", "r.urdf:2", max_linear=0.8, max_angular=1.5)
    assert (tags.topics, tags.odometry, tags.odom_tf, tags.ignored) == ({"cmd_vel": "base/cmd_vel"}, "world", False, ())
    stiff = tags_of(tag.replace("<y_velocity_p_gain>1e4", "<y_velocity_p_gain>0.0"))
    assert stiff.drive is None, "no force moves it sideways: its wheels drive it"
    assert (stiff.topics, stiff.odometry) == ({"cmd_vel": "base/cmd_vel"}, "world")
    assert [each.split(": ")[1] for each in stiff.ignored] == [
        "<max_x_velocity>",
        "<max_y_velocity>",
        "<max_yaw_velocity>",
    ]


def test_the_base_of_a_turtlebot_2() -> None:
    tags = tags_of(
        '<gazebo><plugin name="k" filename="libgazebo_ros_kobuki.so"><publish_tf>0</publish_tf>'
        "<left_wheel_joint_name>l</left_wheel_joint_name><right_wheel_joint_name>r</right_wheel_joint_name>"
        "<wheel_separation>.230</wheel_separation><wheel_diameter>0.070</wheel_diameter><torque>1.0</torque>"
        "<velocity_command_timeout>0.6</velocity_command_timeout><imu_name>imu</imu_name>"
        "<bumper_name>bumpers</bumper_name></plugin></gazebo>"
    )
    assert tags.drive == DriveTag("differential", "r.urdf:2", ("l",), ("r",), separation=0.23, radius=0.035, torque=1.0)
    assert tags.topics == {"cmd_vel": "mobile_base/commands/velocity", "imu": "mobile_base/sensors/imu_data"}
    assert not tags.odom_tf
    assert [each.split(": ")[1] for each in tags.ignored] == ["<bumper_name>"]


def test_a_laser_all_around_and_one_of_gz() -> None:
    ray = (
        "<{0}><scan><horizontal><samples>360</samples><min_angle>0</min_angle><max_angle>6.28319</max_angle>"
        "</horizontal></scan><range><min>0.12</min><max>3.5</max></range></{0}>"
    )
    for kind, inner in (("ray", "ray"), ("gpu_ray", "ray"), ("gpu_lidar", "lidar")):
        tags = tags_of(
            f'<gazebo reference="scan"><sensor type="{kind}" name="s"><pose>0.1 0 0.2 0 0 0.5</pose>',
            f"<topic>/scan</topic><gz_frame_id>front</gz_frame_id><update_rate>40</update_rate>{ray.format(inner)}",
            "</sensor></gazebo>",
        )
        assert tags.laser is not None
        assert tags.laser.angle_max is None
        assert tags.laser.increment == pytest.approx(math.tau / 360)
        assert tags.laser.mount == Mount(xyz=(0.1, 0.0, 0.2), rpy=(0.0, 0.0, 0.5), frame="front")
        assert tags.laser.rate == pytest.approx(100 / 3)
        assert tags.notes == ("r.urdf:2: <sensor>: 40 Hz is 33.3 Hz here: periods are whole physics steps of 5 ms",)
        assert tags.topics == {}


def test_rays_that_are_no_laser_are_none() -> None:
    inner = "<ray><scan><horizontal><samples>5</samples></horizontal></scan></ray>"
    for plugin in ('<plugin name="p" filename="libgazebo_ros_range.so"/>', ""):
        tags = tags_of(f'<gazebo reference="a"><sensor type="ray" name="s">{inner}{plugin}</sensor></gazebo>')
        assert tags.laser is None
        assert tags.ignored == ("r.urdf:2: <sensor>: a ray sensor without a laser plugin is not simulated",)


def test_a_camera_is_as_large_as_the_renderer_can() -> None:
    for kind, library in (("camera", "camera"), ("depth", "openni_kinect")):
        tags = tags_of(
            f'<gazebo reference="eye"><sensor type="{kind}" name="c"><update_rate>30</update_rate>',
            "<camera><horizontal_fov>1.39</horizontal_fov><image><width>1280</width><height>960</height></image>",
            "<clip><near>0.02</near><far>300</far></clip></camera>",
            f'<plugin name="c" filename="libgazebo_ros_{library}.so">',
            "<cameraName>front</cameraName><imageTopicName>rgb/image_raw</imageTopicName>",
            "<frameName>eye_optical</frameName></plugin></sensor></gazebo>",
        )
        camera = tags.camera
        assert camera is not None
        assert (camera.width, camera.height, camera.rate, camera.optical) == (320, 240, 10.0, False)
        assert (camera.link, camera.mount.frame) == ("eye", "eye_optical")
        assert tags.topics == {"camera/image": "front/rgb/image_raw", "camera/camera_info": "front/camera_info"}
        assert "1280 x 960 pixels at 30 Hz are reduced to 320 x 240 at 10 Hz" in tags.notes[0]


def test_friction_in_every_spelling() -> None:
    tags = tags_of(
        '<gazebo reference="a"><mu1>0.8</mu1><mu2>0.5</mu2></gazebo>',
        '<gazebo reference="b"><mu1 value="0.3"/></gazebo>',
        '<gazebo reference="c"><collision><surface><friction><ode><mu>0.1</mu><mu2>0.2</mu2></ode></friction>'
        "</surface></collision></gazebo>",
        "",
        '<gazebo reference="d"><mu1>slippery</mu1></gazebo>',
    )
    assert {link: each.coefficient for link, each in tags.friction.items()} == {"a": 0.5, "b": 0.3, "c": 0.1}
    assert "r.urdf:6: <mu1>: 'slippery' is not a number" in tags.ignored


def test_transmissions_of_either_ros() -> None:
    one = (
        '<transmission name="t"><joint name="j"><hardwareInterface>hardware_interface/VelocityJointInterface'
        '</hardwareInterface></joint><actuator name="m"><hardwareInterface>VelocityJointInterface</hardwareInterface>'
        "</actuator></transmission>"
    )
    two = (
        '<ros2_control name="s" type="system"><joint name="k"><command_interface name="position"/>'
        '<command_interface name="effort"/><state_interface name="position"/></joint></ros2_control>'
    )
    tags = tags_of(one, two, '<gazebo><plugin name="c" filename="libgz_ros2_control-system.so">', "</plugin></gazebo>")
    assert tags.transmissions == (
        Transmission("t", ("j",), ("velocity",)),
        Transmission("k", ("k",), ("position", "effort")),
    )
    assert tags.ros_control is not None
    assert tags.ignored == ()


def test_what_is_not_understood_is_named_once() -> None:
    tags = tags_of(
        '<gazebo reference="a"><selfCollide>true</selfCollide><fluid>water</fluid></gazebo>',
        '<gazebo reference="b"><selfCollide>true</selfCollide><fluid>oil</fluid></gazebo>',
        '<gazebo reference="a"><sensor type="sonar" name="x"/></gazebo>',
        '<gazebo><sensor type="imu" name="y"/></gazebo>',
        '<gazebo><plugin name="gz::sim::systems::Physics" filename="gz-sim-physics-system"/></gazebo>',
    )
    assert tags.ignored == (
        "r.urdf:2: <selfCollide>: the links of a robot pass through each other",
        "r.urdf:2: <fluid>: not understood",
        "r.urdf:4: <sensor>: no sensor of the type 'sonar' is simulated",
        "r.urdf:5: <sensor>: a sensor outside of <gazebo reference=...> belongs to no link",
    )


def test_a_rate_that_is_not_positive_counts_as_missing() -> None:
    for rate in ("0", "-5"):
        tags = tags_of(
            '<gazebo><plugin name="j" filename="libgazebo_ros_joint_state_publisher.so">',
            f"<updateRate>{rate}</updateRate></plugin>",
            f'<plugin name="p" filename="libgazebo_ros_planar_move.so"><odometryRate>{rate}</odometryRate></plugin>',
            f'<plugin name="i" filename="libgazebo_ros_imu.so"><updateRate>{rate}</updateRate>',
            "<bodyName>base</bodyName></plugin></gazebo>",
        )
        assert (tags.joint_rate, tags.odometry_rate) == (None, None)
        assert tags.imu is not None
        assert tags.imu.rate == 100.0
        assert tags.notes == ()


def test_rates_are_those_of_whole_steps() -> None:
    assert [step_rate(rate, 4) for rate in (100, 50, 30, 20, 10)] == pytest.approx([50, 50, 25, 200 / 12, 10])
    assert step_rate(5e-324, 1) == pytest.approx(1e-6)
