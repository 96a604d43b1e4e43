"""The small libraries beside rospy: rosnode, rostopic, rosservice, rosparam, rosmsg, rospkg, roslib, rosgraph."""

import logging
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from services.script.api import kernel
from tests.harness.ros1 import ros1_imports
from tests.services.ros1.rospy.golden import check

WITHIN_S = 60.0


@pytest.fixture
def rospy(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setattr(sys, "argv", ["libraries.py"])
    with ros1_imports():
        import rospy

        rospy.init_node("libs")
        yield rospy
    logging.getLogger("rosout").handlers.clear()


def test_the_graph(rospy: Any) -> None:
    import rosgraph
    import rosnode
    import rosservice
    import rostopic
    from geometry_msgs.msg import PoseStamped
    from std_msgs.msg import String
    from std_srvs.srv import SetBool

    rospy.Publisher("chatter", String, queue_size=1)
    rospy.Subscriber("goal", PoseStamped, lambda message: None)
    rospy.Service("~switch", SetBool, lambda request: (request.data, "ok"))
    seen = {"/chatter", "/goal", "/libs/get_loggers", "/libs/set_logger_level", "/libs/switch"}
    assert kernel().wait_until(lambda: seen <= {each.name for each in kernel().graph()}, WITHIN_S)
    names = {"rosgraph": rosgraph, "rosnode": rosnode, "rosservice": rosservice, "rostopic": rostopic}
    names |= {"String": String, "PoseStamped": PoseStamped, "SetBool": SetBool}
    check(
        """
        rosnode.get_node_names() -> ['/libs']
        rosnode.get_node_names('/a') -> []
        (rosnode.rosnode_ping('libs'), rosnode.rosnode_ping('/other')) -> (True, False)
        rosnode.kill_nodes(['other']) -> ([], ['/other'])
        rostopic.get_topic_type('/chatter') -> ('std_msgs/String', '/chatter', None)
        rostopic.get_topic_type('/nope') -> (None, None, None)
        rostopic.get_topic_class('/chatter')[0] is String -> True
        rostopic.get_topic_class('/goal/pose/position/x')[2](PoseStamped()) -> 0.0
        rostopic.find_by_type('geometry_msgs/PoseStamped') -> ['/goal']
        rostopic.get_info_text('/chatter').split() -> ['Type:', 'std_msgs/String', 'Publishers:', '*', '/libs',
            'Subscribers:', 'None']
        sorted(rosservice.get_service_list()) -> ['/libs/get_loggers', '/libs/set_logger_level', '/libs/switch']
        rosservice.get_service_type('/libs/set_logger_level') -> 'roscpp/SetLoggerLevel'
        rosservice.get_service_type('libs/switch') -> 'std_srvs/SetBool'
        rosservice.get_service_node('/libs/switch') -> '/libs'
        rosservice.get_service_class_by_name('/libs/switch') is SetBool -> True
        rosservice.call_service('/libs/switch', [True])[1].message -> 'ok'
        rosservice.call_service('/nope', []) !! rosservice.ROSServiceException: Service [/nope] is not available.
        ['/libs/switch', ['/libs']] in rosgraph.Master('/x').getSystemState()[2] -> True
        rosgraph.Master('/x').lookupNode('/nope') !! rosgraph.masterapi.MasterError: unknown node [/nope]
        rosgraph.is_master_online() -> True
        """,
        names,
    )


def test_parameter_files(rospy: Any, tmp_path: Path) -> None:
    import rosparam

    (tmp_path / "p.yaml").write_text("gains: {p: 1, i: 0.5}\nangle: deg(90)\nother: rad(pi/4)\n")
    for values, namespace in rosparam.load_file(str(tmp_path / "p.yaml"), default_namespace="/arm"):
        rosparam.upload_params(namespace, values)
    assert rospy.get_param("/arm/gains") == {"p": 1, "i": 0.5}
    assert rospy.get_param("/arm/angle") == pytest.approx(math.pi / 2)
    assert rosparam.get_param("/arm/other") == pytest.approx(math.pi / 4)
    assert rosparam.list_params("/arm") == ["/arm/angle", "/arm/gains/i", "/arm/gains/p", "/arm/other"]
    rosparam.dump_params(str(tmp_path / "out.yaml"), "/arm/gains")
    assert (tmp_path / "out.yaml").read_text() == "i: 0.5\np: 1\n"
    rosparam.delete_param("/arm/gains")
    with pytest.raises(rosparam.RosParamException, match=r"\[/arm/gains\] is not set"):
        rosparam.get_param("/arm/gains")
    with pytest.raises(rosparam.RosParamException, match="does not exist"):
        rosparam.load_file(str(tmp_path / "missing.yaml"))
    with pytest.raises(rosparam.RosParamException, match="invalid angle"):
        rosparam.load_str("x: deg(exit)", "x.yaml")


def test_packages_and_types(rospy: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import resource_retriever
    import roslib
    import roslib.message
    import roslib.packages
    import rosmsg
    import rospkg

    package = tmp_path / "src" / "folder"
    package.mkdir(parents=True)
    (package / "package.xml").write_text(
        "<package><name>my_robot</name><version>1.2.0</version><depend>rospy</depend></package>"
    )
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "src"))
    roslib.load_manifest("my_robot")
    pack = rospkg.RosPack()
    assert (pack.get_path("my_robot"), roslib.packages.get_pkg_dir("my_robot")) == (str(package), str(package))
    assert (pack.get_manifest("my_robot").version, pack.get_depends("my_robot")) == ("1.2.0", ["rospy"])
    assert rospkg.get_package_name(str(package / "scripts")) == "my_robot"
    url = "package://my_robot/package.xml"
    assert resource_retriever.get_filename(url) == f"file://{package}/package.xml"
    assert resource_retriever.get(url).startswith(b"<package><name>my_robot")
    with pytest.raises(rospkg.ResourceNotFound, match="my_robt; did you mean 'my_robot'"):
        pack.get_path("my_robt")
    assert (Path(pack.get_path("dynamic_reconfigure")) / "server.py").is_file()  # part of Elea
    assert roslib.message.get_message_class("std_msgs/String").__name__ == "String"
    assert rosmsg.get_srv_text("std_srvs/SetBool") == "bool data\n---\nbool success\nstring message\n"
    assert rosmsg.get_msg_text("geometry_msgs/Point") == "float64 x\nfloat64 y\nfloat64 z\n"


def test_names(rospy: Any) -> None:
    from rosgraph import names

    check(
        """
        names.load_mappings(['a:=b', '_p:=1', '__name:=x', '~q:=r', 'x', '--a:=b', 'a:=']) -> {'a': 'b', '__name': 'x',
            '~q': 'r'}
        names.resolve_name('~/a', '/ns/node') -> '/ns/node/a'
        names.resolve_name('a//b/', '/ns/node') -> '/ns/a/b'
        names.resolve_name('', '/ns/node') -> '/ns/'
        names.ns_join('~', 'a') -> '~a'
        names.ns_join('/a/', 'b') -> '/a/b'
        names.namespace('/a/b/') -> '/a/'
        names.is_legal_name('a b') -> False
        names.is_legal_base_name('a/b') -> False
        names.make_global_ns('a') -> '/a/'
        names.clean_name('/my robot/2nd-wheel') -> '/my_robot/_2nd_wheel'
        """,
        {"names": names},
    )
