"""A launch file becomes a fleet: robots from spawned models, services from nodes, notes about omissions."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest

from deploy.controller_files import gain_values
from deploy.fleet_validation import service_identity
from deploy.launch.fleet_of_launch import fleet_of_launch
from deploy.launch.open_launch import checked_fleet, find_launch, make_fleet
from deploy.launch.packages import STAND_INS, LaunchPackages
from deploy.processes import plan_processes
from deploy.restart_policy import RestartPolicy
from deploy.rosparam import fleet_parameter_tree
from deploy.service_parameters import RunOptions
from models import urdf_path
from services.catalog import is_script
from services.runtime.errors import BadInput
from tests.deploy.launch.launch_harness import LaunchWorkspace

WORLD = '<include file="$(find gazebo_ros)/launch/empty_world.launch"><arg name="gui" value="{gui}"/>{more}</include>'
DESCRIBED = (
    '<param name="robot_description" command="$(find xacro)/xacro --inorder '
    "'$(find turtlebot3_description)/urdf/turtlebot3_waffle.urdf.xacro'\"/>"
)
SPAWN = '<node name="spawn" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model {args}"/>'


@pytest.fixture
def workspace(tmp_path: Path) -> LaunchWorkspace:
    return LaunchWorkspace(tmp_path)


def kinds(table: dict[str, Any]) -> list[str]:
    return [Path(each["kind"]).name for each in table.get("service", ())]


def test_what_is_printed_is_the_fleet_that_runs(workspace: LaunchWorkspace) -> None:
    text = f"""
      {WORLD.format(gui="true", more="")} {DESCRIBED} {SPAWN.format(args="rover -x 1.5 -Y 0.5 -z 0.0")}
      <group ns="talks">
        <node pkg="talks" type="talker.py" name="talker" args="a:=b '1 2'" respawn="true" respawn_delay="3" cwd="node">
          <param name="rate" value="10"/> <remap from="chatter" to="/news"/> <env name="A" value="1"/>
        </node>
      </group>
      <node pkg="talks" type="listener" name="listener" required="true" output="screen"/>
    """
    made = workspace.fleet(text)
    assert tomllib.loads(made.toml()) == made.table
    assert made.has_gazebo
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", made)
    (robot,) = fleet.robot
    assert (robot.name, robot.model, robot.namespace, robot.frame_prefix) == ("rover", "waffle", "/", "")
    assert (robot.pose.x, robot.pose.yaw, robot.parameters) == (1.5, 0.5, {"cmd_vel_timeout": 0.0, "odometry": "world"})
    assert (fleet.world, fleet.run.mode, fleet.run.ends) == ("empty", "real", "never")
    assert kinds(made.table) == ["logger", "panel", "talker.py", "listener"]
    talker, listener = fleet.service[2:]
    assert (talker.namespace, talker.name, talker.args) == ("/talks", "talker", ("a:=b", "1 2"))
    assert (talker.remap, talker.environment) == ({"chatter": "/news"}, {"A": "1"})
    assert talker.cwd == str(workspace.source / "talks/scripts")
    assert isinstance(talker.restart, RestartPolicy)
    assert (talker.restart.when, talker.restart.first) == ("always", 3)
    assert (listener.required, listener.restart, listener.cwd, listener.output) == (True, "never", "", "screen")
    assert talker.output == "log"
    assert fleet.rosparam == {"use_sim_time": True, "talks": {"talker": {"rate": 10}}}
    assert any("turtlebot3_waffle.urdf.xacro is Elea's model waffle" in each for each in made.notes)


def test_several_robots_have_namespaces_and_frames_of_their_own(workspace: LaunchWorkspace) -> None:
    one = "".join(
        f'<group ns="{name}"><param name="tf_prefix" value="{prefix}"/>{DESCRIBED}{SPAWN.format(args=name)}</group>'
        for name, prefix in (("tb3_0", "tb3_0"), ("tb3_1", "other"))
    )
    robots = workspace.table(WORLD.format(gui="false", more="") + one)["robot"]
    assert [(each["namespace"], each["frame_prefix"]) for each in robots] == [
        ("/tb3_0", "tb3_0/"),
        ("/tb3_1", "other/"),
    ]
    two = f"{DESCRIBED}{SPAWN.format(args='a')}" + SPAWN.format(args="b -robot_namespace /").replace(
        '"spawn"', '"again"'
    )
    made = workspace.fleet(two)
    assert [each["namespace"] for each in made.table["robot"]] == ["/", "/b"]
    assert any("b would share the topics in /" in each for each in made.notes)


def test_a_diff_drive_controller_gives_its_name_and_figures(workspace: LaunchWorkspace) -> None:
    workspace.write(
        "robots/config/control.yaml",
        "p3dx_velocity_controller:\n  type: diff_drive_controller/DiffDriveController\n  cmd_vel_timeout: 0.25\n"
        "  publish_rate: 100\n  wheel_radius : 0.15\n  left_wheel: a\n  odom_frame_id: /odom_wheels\n"
        "  base_frame_id: base_footprint\n  enable_odom_tf: false\n  publish_cmd: true\n  open_loop: true\n"
        "  velocity_rolling_window_size: 4\n  left_wheel_radius_multiplier: 1.1\n"
        "  linear: {x: {has_velocity_limits: true, max_velocity: 0.75, max_acceleration: 0.3}}\n",
    )
    table = workspace.table("""<group ns="/p3dx">
      <param name="robot_description"
             command="$(find xacro)/xacro.py '$(find p3dx_description)/urdf/pioneer3dx.xacro'"/>
      <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model p3dx"/>
      <rosparam command="load" file="$(find robots)/config/control.yaml"/>
      <node name="c" pkg="controller_manager" type="spawner" args="--namespace=/p3dx
        p3dx_velocity_controller --shutdown-timeout 3"/></group>""")
    (robot,) = table["robot"]
    assert (robot["model"], robot["namespace"], robot["frame_prefix"]) == ("p3dx", "/p3dx", "")
    assert robot["parameters"] == {
        "cmd_vel_timeout": 0.25,
        "publish_rate": 50.0,
        "wheel_radius": 0.15,
        "linear": {"max_velocity": 0.75},
        "odom_frame_id": "/odom_wheels",
        "base_frame_id": "base_footprint",
        "enable_odom_tf": False,
        "publish_cmd": True,
        "open_loop": True,
        "velocity_rolling_window_size": 4,
        "left_wheel_radius_multiplier": 1.1,
        "controller": "p3dx_velocity_controller",
    }
    assert kinds(table) == []


def test_the_plugin_of_a_drive_gives_its_namespace_to_a_model_of_ours(workspace: LaunchWorkspace) -> None:
    drive = (
        '<robot name="p3dx"><gazebo><plugin name="d" filename="libgazebo_ros_diff_drive.so"><leftJoint>l</leftJoint>'
        "<rightJoint>r</rightJoint><commandTopic>{}</commandTopic></plugin></gazebo></robot>"
    )
    spawn = """<group ns="{}"><param name="robot_description" textfile="$(find robots)/{}/p3dx.urdf"/>
      <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model one"/></group>"""
    cases = (
        ("p3dx/cmd_vel", "/", "/p3dx"),
        ("/p3dx/cmd_vel", "/p3dx", "/p3dx"),
        ("p3dx/cmd_vel", "/fleet", "/fleet/p3dx"),
        ("cmd_vel", "/", "/"),
        ("drive", "/", "/"),
    )
    for case, (topic, group, namespace) in enumerate(cases):
        workspace.write(f"robots/{case}/p3dx.urdf", drive.format(topic))
        made = workspace.fleet(spawn.format(group, case))
        (robot,) = made.table["robot"]
        assert (robot["model"], robot["namespace"]) == ("p3dx", namespace)
        assert any("the topic of its drive plugin" in each for each in made.notes) == (namespace != group)
    workspace.write("robots/broken/p3dx.urdf", "<robot")
    assert workspace.table(spawn.format("/", "broken"))["robot"][0]["namespace"] == "/"


def test_joint_controllers_are_started_from_the_loaded_file(workspace: LaunchWorkspace) -> None:
    config = workspace.write(
        "robots/config/joints.yaml",
        "arm:\n  state:\n    type: joint_state_controller/JointStateController\n  position:\n"
        "    type: effort_controllers/JointPositionController\n    joint: bear_link\n    pid: {p: 1.0, i: 0.0}\n",
    )
    workspace.write("robots/config/states.yaml", "arm:\n  state: {publish_rate: 50}\n")
    urdf = workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    made = workspace.fleet("""
      <param name="robot_description" textfile="$(find robots)/urdf/mine.urdf"/>
      <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model one"/>
      <rosparam command="load" file="$(find robots)/config/states.yaml"/>
      <rosparam command="load" file="$(find robots)/config/joints.yaml"/>
      <node name="c" pkg="controller_manager" type="spawner" ns="arm" args="state position --timeout 20"/>""")
    (robot,), (manager,) = made.table["robot"], made.table["service"]
    assert (robot["model"], robot["namespace"]) == (str(urdf), "/arm")
    assert (manager["kind"], manager["namespace"]) == ("controller_manager", "/arm")
    assert manager["parameters"] == {"config": str(config), "robot": "one", "controllers": ["position"]}
    assert checked_fleet(workspace.source / "talks/launch/test.launch", made).service[0].kind == "controller_manager"


def test_joint_controllers_are_started_from_parameters_that_the_launch_file_states(workspace: LaunchWorkspace) -> None:
    urdf = workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    text = """<node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -file {urdf} -model one"/><group ns="arm">
      <rosparam>
        position: {{type: effort_controllers/JointPositionController, joint: bear_link, pid: {{p: 1.0, i: 0.0}}}}
      </rosparam>
      <node name="c" pkg="controller_manager" type="spawner" args="{names}"/></group>"""
    made = workspace.fleet(text.format(urdf=urdf, names="position"))
    (manager,) = made.table["service"]
    assert json.loads(manager["parameters"]["config"])["arm"]["position"]["joint"] == "bear_link"
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", made)
    assert list(gain_values(fleet.service[0], None)) == ["/arm/position/pid"]
    left_out = workspace.fleet(text.format(urdf=urdf, names="position velocity"))
    assert any("no <rosparam> configures position, velocity" in each for each in left_out.notes)


ARM = """<param name="robot_description" textfile="$(find robots)/urdf/mine.urdf"/>
  <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model one"/>"""
TWO = "a: {type: position_controllers/JointPositionController, joint: bear_link}\nb: {type: KIND, joint: bear_link}\n"


def spawner(name: str, args: str, kind: str = "spawner", ns: str = "/") -> str:
    return f'<node name="{name}" pkg="controller_manager" type="{kind}" args="{args}" ns="{ns}"/>'


@pytest.mark.parametrize(
    "second",
    [spawner("t", "--stopped b"), spawner("t", "load b", "controller_manager")],
    ids=["stopped", "load"],
)
def test_controllers_that_are_only_loaded_are_not_started(workspace: LaunchWorkspace, second: str) -> None:
    workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    load = f"<rosparam>{TWO.replace('KIND', 'effort_controllers/JointEffortController')}</rosparam>"
    for spawners in (spawner("c", "a") + second, second + spawner("c", "a")):
        made = workspace.fleet(ARM + load + spawners)
        (manager,) = made.table["service"]
        assert manager["parameters"]["controllers"] == ["a"]
        assert set(json.loads(manager["parameters"]["config"])) == {"a", "b"}
        assert any("b: not started, as stated" in each for each in made.notes)
        checked_fleet(workspace.source / "talks/launch/test.launch", made)
    made = workspace.fleet(ARM + load + second)
    assert "service" not in made.table
    assert any("no controller manager in /" in each for each in made.notes)


def test_a_robot_has_one_controller_manager_for_all_its_spawners(workspace: LaunchWorkspace) -> None:
    workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    both = workspace.write("robots/both.yaml", TWO.replace("KIND", "position_controllers/JointPositionController"))
    workspace.write("robots/a.yaml", both.read_text().split("\n")[0])
    workspace.write("robots/b.yaml", both.read_text().split("\n")[1])
    files = [f'<rosparam file="$(find robots)/{name}.yaml"/>' for name in ("a", "b", "both")]
    two = spawner("c", "a") + spawner("d", "b a") + spawner("e", "none")
    for load in (files[0] + files[1], files[2]):
        made = workspace.fleet(ARM + load + two)
        (manager,) = made.table["service"]
        assert manager["parameters"]["controllers"] == ["a", "b"]
        assert any("e" in each and "no <rosparam> configures none" in each for each in made.notes)
    assert manager["parameters"]["config"] == str(both)


@pytest.mark.parametrize(
    ("load", "expected"),
    [
        ('<rosparam file="$(find robots)/one.yaml"/>', None),
        ('<rosparam file="$(find robots)/one.yaml" subst_value="true"/>', None),
        ('<rosparam file="$(find robots)/one.yaml"/><param name="a/pid/p" value="7.0"/>', {"p": 7.0}),
        ('<rosparam file="$(find robots)/one.yaml"/><rosparam file="$(find robots)/gains.yaml"/>', {"hardware": 5}),
        ('<arg name="j" value="bear"/><rosparam file="$(find robots)/text.yaml" subst_value="true"/>', {}),
    ],
    ids=["file", "nothing to substitute", "parameter", "gains", "substitution"],
)
def test_controllers_have_what_is_on_the_parameter_server(
    workspace: LaunchWorkspace, load: str, expected: dict[str, float] | None
) -> None:
    workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    head = "states: {type: joint_state_controller/JointStateController, publish_rate: 40}\n"
    text = f"{head}a: {{type: effort_controllers/JointPositionController, joint: bear_link, pid: {{p: 1.0}}}}\n"
    one = workspace.write("robots/one.yaml", text)
    workspace.write("robots/text.yaml", text.replace("bear_", "$(arg j)_"))
    workspace.write("robots/gains.yaml", "gazebo_ros_control: {pid_gains: {bear_link: {p: 5}}}\n")
    made = workspace.fleet(ARM + load + spawner("c", "a states"))
    (manager,) = made.table["service"]
    if expected is None:
        assert manager["parameters"]["config"] == str(one)
        return
    tree = json.loads(manager["parameters"]["config"])
    assert tree["a"]["joint"] == "bear_link"
    assert tree["a"]["pid"]["p"] == expected.get("p", 1.0)
    assert tree["states"]["publish_rate"] == 40
    assert ("gazebo_ros_control" in tree) == ("hardware" in expected)
    checked_fleet(workspace.source / "talks/launch/test.launch", made)


def test_controllers_belong_to_the_robot_in_their_namespace(workspace: LaunchWorkspace) -> None:
    workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    second = ARM.replace('"s"', '"s2"').replace("-model one", "-model two -robot_namespace /r2")
    load = f"<rosparam ns='r2'>{TWO.split(chr(10))[0]}</rosparam>"
    made = workspace.fleet(ARM + second + load + spawner("c", "a", ns="r2"))
    assert [each["namespace"] for each in made.table["robot"]] == ["/", "/r2"]
    (manager,) = made.table["service"]
    assert (manager["namespace"], manager["parameters"]["robot"]) == ("/r2", "two")


def test_controllers_of_a_launch_file_that_joins_are_those_of_a_running_robot(workspace: LaunchWorkspace) -> None:
    plugin = (
        '<gazebo><plugin name="c" filename="libgazebo_ros_control.so"><robotNamespace>/rrbot</robotNamespace>'
        "</plugin></gazebo></robot>"
    )
    workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text().replace("</robot>", plugin))
    world = workspace.fleet(WORLD.format(gui="false", more="") + ARM)
    assert world.table["robot"][0]["namespace"] == "/rrbot"
    assert any("in /rrbot, the namespace of its gazebo_ros_control" in each for each in world.notes)
    control = f"<rosparam ns='rrbot'>{TWO.split(chr(10))[0]}</rosparam>" + spawner("c", "a", ns="rrbot")
    joins = workspace.fleet(control)
    (manager,) = joins.table["service"]
    assert (manager["kind"], manager["namespace"]) == ("controller_manager", "/rrbot")
    assert (manager["parameters"]["robot"], manager["parameters"]["controllers"]) == ("rrbot", ["a"])
    (service,) = checked_fleet(workspace.source / "talks/launch/test.launch", joins).service
    assert service_identity(service, None).node == "/rrbot/controller_manager"
    alone = workspace.fleet(WORLD.format(gui="false", more="") + control)
    assert any("is left out: no robot is spawned" in each for each in alone.notes)


def test_an_object_with_a_urdf_does_not_change_the_frames_of_the_robot(workspace: LaunchWorkspace) -> None:
    workspace.write("robots/urdf/table.urdf", '<robot name="t"><link name="top"/></robot>')
    table = '<node name="t" pkg="gazebo_ros" type="spawn_model" args="-urdf -file {} -model table"/>'
    table = table.format("$(find robots)/urdf/table.urdf")
    rover = DESCRIBED + SPAWN.format(args="rover")
    for text in (rover + table, table + rover):
        made = workspace.fleet(text)
        robots = {each["name"]: each for each in made.table["robot"]}
        assert (robots["rover"]["namespace"], robots["rover"]["frame_prefix"]) == ("/", "")
        assert robots["table"]["namespace"] == "/table"
        assert "frame_prefix" not in robots["table"]
        assert not any("with several robots" in each for each in made.notes)
        checked_fleet(workspace.source / "talks/launch/test.launch", made)
    made = workspace.fleet(rover + SPAWN.format(args="second").replace('"spawn"', '"again"'))
    assert not any("frame_prefix" in each for each in made.table["robot"])
    assert any("with several robots" in each for each in made.notes)


def test_a_description_stays_under_its_own_name(workspace: LaunchWorkspace) -> None:
    workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    one = ARM.replace("-model one", "-model one -robot_namespace /r1")
    two = ARM.replace('"s"', '"s2"').replace("-model one", "-model two -robot_namespace /r2")
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", workspace.fleet(one + two))
    tree = fleet_parameter_tree(fleet)
    assert tree["robot_description"] == urdf_path("arm").read_text()
    assert {"robot_description"} == tree["r1"].keys() == tree["r2"].keys()
    assert "rosparam" not in workspace.fleet(one).table  # the fleet itself has that of its only robot in the root, too


@pytest.mark.parametrize("name", ["logger", "panel", "recorder"])
def test_a_node_named_like_one_of_the_fleet_has_another_name(workspace: LaunchWorkspace, name: str) -> None:
    node = f'<node pkg="talks" type="talker.py" name="{name}"><param name="rate" value="5"/></node>'
    made = workspace.fleet(WORLD.format(gui="true", more="") + node)
    assert made.table["service"][-1]["name"] == f"{name}_node"
    assert made.table["rosparam"][f"{name}_node"] == {"rate": 5}
    assert any(f"a node /{name} of their own" in each for each in made.notes)
    checked_fleet(workspace.source / "talks/launch/test.launch", made)


def test_what_a_package_that_is_not_here_would_include_is_left_out(workspace: LaunchWorkspace) -> None:
    include = '<include file="$(find kinect_bringup)/launch/3dsensor.launch"><arg name="x" value="1"/></include>'
    made = workspace.fleet(f'{include}<node name="t" pkg="talks" type="talker.py"/>')
    assert kinds(made.table) == ["talker.py"]
    assert any("3dsensor.launch is left out: there is no package 'kinect_bringup'" in each for each in made.notes)
    with pytest.raises(BadInput, match=r":2: there is no package 'kinect_bringup'"):
        workspace.fleet(include)


def test_a_program_of_a_package_need_not_use_ros(workspace: LaunchWorkspace) -> None:
    workspace.write("talks/scripts/plain.py", "import missing_library\n")
    made = workspace.fleet('<node name="p" pkg="talks" type="plain.py"/>')
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", made)
    assert is_script(fleet.service[0].kind)


def test_a_robot_starts_with_its_joints_as_they_are_spawned(workspace: LaunchWorkspace) -> None:
    urdf = workspace.write("robots/urdf/mine.urdf", urdf_path("arm").read_text())
    made = workspace.fleet(
        f"""<node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -file {urdf} -model one -R 0.1
      -J bear_link -0.25 -J elbow 1 -J bear_link_ 9 -x -1 -Y 1e-1 -reference_frame table -unpause"/>"""
    )
    (robot,) = made.table["robot"]
    assert robot["joints"] == {"bear_link": -0.25}
    assert robot["pose"] == {"x": -1.0, "yaw": 0.1}
    for text in ("-R 0.1", "-reference_frame table", "-J elbow 1 is left out", "did you mean 'bear_link'"):
        assert any(text in each for each in made.notes), (text, made.notes)
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", made)
    assert fleet.robot[0].joints == {"bear_link": -0.25}


def test_a_heading_in_degrees_is_what_gazebo_makes_of_it_and_is_noted(workspace: LaunchWorkspace) -> None:
    made = workspace.fleet(DESCRIBED + SPAWN.format(args="rover -Y 90"))
    (robot,) = made.table["robot"]
    assert robot["pose"] == {"yaw": math.remainder(90, math.tau)}
    assert any(
        "-Y 90 is in rad, as in Gazebo" in each and "90 degrees would be 1.5708 rad" in each for each in made.notes
    )
    checked_fleet(workspace.source / "talks/launch/test.launch", made)


def test_a_robot_and_a_world_of_the_users_own_are_taken(workspace: LaunchWorkspace) -> None:
    urdf = workspace.write(
        "robots/urdf/box.urdf",
        '<robot name="box"><link name="base"><visual><geometry><box size="1 1 1"/></geometry></visual><collision>'
        '<geometry><box size="1 1 1"/></geometry></collision><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>',
    )
    world = workspace.write("robots/worlds/own.world", '<sdf version="1.6"><world name="own"/></sdf>')
    more = '<arg name="world_name" value="$(find robots)/worlds/own.world"/>'
    table = workspace.table(
        WORLD.format(gui="false", more=more)
        + '<node name="s" pkg="gazebo_ros" type="spawn_model" '
        + 'args="-urdf -model b -file $(find robots)/urdf/box.urdf"/>'
    )
    assert table["world"] == str(world)
    assert table["robot"] == [{"name": "b", "model": str(urdf), "namespace": "/", "frame_prefix": ""}]
    for name, ours in {"turtlebot3_house": "house", "turtlebot3_stage_2": "arena", "empty": "empty"}.items():
        more = f'<arg name="world_name" value="$(find turtlebot3_gazebo)/worlds/{name}.world"/>'
        assert workspace.table(WORLD.format(gui="false", more=more))["world"] == ours
    more = '<arg name="world_name" value="$(find robots)/worlds/won.world"/>'
    with pytest.raises(BadInput, match=r"there is no world .*won\.world; did you mean 'own\.world'"):
        workspace.table(WORLD.format(gui="false", more=more))


def test_a_relative_world_is_looked_for_where_gazebo_does(workspace: LaunchWorkspace) -> None:
    """In GAZEBO_RESOURCE_PATH and in the folders that packages export, never as a file missing from its package."""
    gazebo = '{env}<node name="gazebo" pkg="gazebo_ros" type="gzserver" args="-e ode worlds/{world}.world"/>'
    empty = '<sdf version="1.6"><world name="own"/></sdf>'
    made = workspace.fleet(gazebo.format(env="", world="shapes"))  # a world that comes with Gazebo
    assert made.table["world"] == "empty"
    assert made.notes == ["the world worlds/shapes.world was not found; an empty ground replaces it"]
    named = workspace.write("elsewhere/worlds/named.world", empty)
    path = f'<env name="GAZEBO_RESOURCE_PATH" value="/nowhere:{workspace.source}/elsewhere"/>'
    assert workspace.table(gazebo.format(env=path, world="named"))["world"] == str(named)
    exported = workspace.write("robots/media/worlds/own.world", empty)
    workspace.write(
        "robots/package.xml",
        '<package><name>robots</name><export><gazebo_ros gazebo_media_path="${prefix}/media"/></export></package>',
    )
    assert workspace.table(gazebo.format(env="", world="own"))["world"] == str(exported)


def test_well_known_nodes_are_services_of_ours_or_need_none(workspace: LaunchWorkspace) -> None:
    workspace.write("robots/maps/map.yaml", "image: map.pgm\n")
    made = workspace.fleet("""
      <node pkg="rviz" type="rviz" name="rviz"/>  <node pkg="rqt_plot" type="rqt_plot" name="plot"/>
      <node pkg="tf" type="static_transform_publisher" name="st" args="1 2 3 0.1 0.2 0.3 /base_link /laser 100"/>
      <node pkg="tf2_ros" type="static_transform_publisher" name="sq" args="1 2 3 0 0 0 1 base_link camera"/>
      <node pkg="map_server" type="map_server" name="maps" args="$(find robots)/maps/map.yaml"/>
      <node pkg="turtlesim" type="turtlesim_node" name="sim"/>
      <node pkg="turtlesim" type="turtle_teleop_key" name="keys"/>
      <node pkg="talks" type="keys.py" name="own_keys" launch-prefix="xterm -e"/>
      <node pkg="joy" type="joy_node" name="joy"/>
    """)
    by_kind = {each["kind"]: each.get("parameters") for each in made.table["service"]}
    assert set(by_kind) == {"logger", "panel", "static_transform", "map_server", "turtlesim"}
    assert by_kind["map_server"] == {"map": str(workspace.source / "robots/maps/map.yaml")}
    first, second = (each["parameters"] for each in made.table["service"] if each["kind"] == "static_transform")
    assert (first["yaw"], first["pitch"], first["roll"]) == (0.1, 0.2, 0.3)
    assert (first["frame_id"], first["child_frame_id"]) == ("base_link", "laser")
    assert second["quaternion"] == [0.0, 0.0, 0.0, 1.0]
    assert any("./elea teleop /turtle1" in each for each in made.by_hand)
    assert any("./elea rosrun talks keys.py" in each for each in made.by_hand)
    checked_fleet(
        workspace.source / "talks/launch/test.launch", workspace.fleet('<node pkg="rviz" type="rviz" name="r"/>')
    )


def test_what_cannot_be_run_is_named_and_only_an_error_if_required(workspace: LaunchWorkspace) -> None:
    cases = {
        'pkg="talks" type="fast"': "talks has no Python program of this name, and C++ is not run",
        'pkg="talks" type="tlker.py"': "no Python program of this name; did you mean 'talker.py'",
        'pkg="tlaks" type="x"': "there is no package 'tlaks'; did you mean 'talks'",
        'pkg="move_base" type="move_base"': "the navigation stack is not part of Elea",
        'pkg="gmapping" type="slam_gmapping"': "SLAM is not part of Elea",
    }
    for attributes, said in cases.items():
        made = workspace.fleet(f'<node {attributes} name="n"/>')
        assert any("test.launch:2: " in each and "is left out" in each and said in each for each in made.notes), (
            attributes
        )
        with pytest.raises(BadInput, match=r"test\.launch:2: .* is required, and cannot be run"):
            workspace.fleet(f'<node {attributes} name="n" required="true"/>')
    for attributes, said in {
        'type="spawn_model" args="-urdf -param robot -model a"': r"there is no parameter /robot",
        'type="spawn_model" args="-urdf -model a"': r"needs -param, -file or -database",
        'type="spawn_model" args="-urdf -x one -param p"': r"-x 'one' is not a number",
        'type="spawn_model" args="-urdf -J elbow -param p"': r"-J elbow '-param' is not a number",
        'type="spawn_model" args="-urdf -file /nowhere.urdf -model a"': r"file /nowhere\.urdf does not exist",
    }.items():
        with pytest.raises(BadInput, match=rf"test\.launch:2: .*{said}"):
            workspace.fleet(f'<node pkg="gazebo_ros" name="n" {attributes}/>')


def test_args_with_an_open_quote_are_told_with_file_and_line(workspace: LaunchWorkspace) -> None:
    for node in (
        'pkg="gazebo_ros" type="gzserver"',
        'pkg="gazebo_ros" type="spawn_model"',
        'pkg="map_server" type="map_server"',
        'pkg="tf" type="static_transform_publisher"',
        'pkg="controller_manager" type="spawner"',
        'pkg="talks" type="talker.py"',
    ):
        with pytest.raises(BadInput, match=r"test\.launch:2: the args of n cannot be read: No closing"):
            workspace.fleet(f'<node name="n" {node} args="it\'s"/>')


def test_stand_ins_of_well_known_packages_are_fleets(workspace: LaunchWorkspace) -> None:
    packages = workspace.packages()
    for path in sorted(STAND_INS.rglob("*.launch")):
        _, made = make_fleet(path, {}, packages)
        assert checked_fleet(path, made), path


def test_a_launch_file_is_found_by_its_package_from_the_workspace(workspace: LaunchWorkspace) -> None:
    path = workspace.launch_file("")
    assert find_launch(["talks", "test.launch"], workspace.source.parent)[0] == path
    assert find_launch([str(path)], Path("/"))[0] == path
    stand_in, _ = find_launch(["turtlebot3_gazebo", "turtlebot3_world.launch"], workspace.source)
    assert stand_in.is_relative_to(STAND_INS)
    errors = {
        ("talks", "tset.launch"): r"has no launch file tset\.launch; did you mean 'test\.launch'",
        ("tlaks", "test.launch"): r"there is no package 'tlaks'; did you mean 'talks'",
        ("talks",): r"there is no launch file talks; for a launch file of a package, give both: talks FILE\.launch",
        ("a", "b", "c"): r"name a package and its launch file",
    }
    for words, said in errors.items():
        with pytest.raises(BadInput, match=said):
            find_launch(list(words), workspace.source)


def test_programs_are_found_with_or_without_their_ending(workspace: LaunchWorkspace) -> None:
    packages: LaunchPackages = workspace.packages()
    workspace.write("talks/deep/down/here.py", "import rospy\n")
    assert packages.script("talks", "talker") == workspace.source / "talks/scripts/talker.py"
    assert packages.script("talks", "listener") == workspace.source / "talks/nodes/listener"
    assert packages.script("talks", "here.py") == workspace.source / "talks/deep/down/here.py"
    assert packages.script("talks", "fast") is None
    assert packages.scripts("talks") == ["here.py", "keys.py", "listener", "talker.py"]


def test_a_test_ends_the_run_and_is_left_out_of_roslaunch(workspace: LaunchWorkspace) -> None:
    text = (
        '<node pkg="talks" type="listener" name="listener"/>'
        '<test pkg="talks" type="talker.py" test-name="check" time-limit="7" args="-v">'
        '<param name="x" value="1"/></test>'
    )
    launch = workspace.read(text)
    assert kinds(fleet_of_launch(launch, workspace.packages()).table) == ["listener"]
    made = fleet_of_launch(workspace.read(text), workspace.packages(), launch.tests[0])
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", made)
    check = next(each for each in fleet.service if each.name == "check")
    assert (check.required, check.args, check.restart) == (True, ("-v",), "never")
    assert (fleet.run.ends, fleet.run.duration, fleet.rosparam["check"]) == ("duration", 7.0, {"x": 1})
    (process,) = (each for each in plan_processes(fleet, RunOptions(folder=workspace.source)) if each.ends_run)
    assert process.name == "check"
    absent = workspace.read('<test pkg="talks" type="fast" test-name="t"/>').tests[0]
    with pytest.raises(BadInput, match=r"test\.launch:2: the test talks/fast cannot be run"):
        fleet_of_launch(launch, workspace.packages(), absent)
