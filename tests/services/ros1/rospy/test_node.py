"""A node's start, names, parameters and log are those of real rospy."""

import logging
import re
import sys
import warnings
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

from services.script.api import kernel
from tests.harness.ros1 import ros1_imports
from tests.services.ros1.rospy.golden import check

_ARGUMENTS = ["probe.py", "cmd_vel:=/tb3_0/cmd_vel", "odom:=robot/odom", "_speed:=0.3", "_list:=[1, 2]", "_text:=hello"]
_ARGUMENTS += ["_flag:=true", "plain_arg", "--opt", "3"]


@pytest.fixture
def rospy(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Any]:
    """rospy, as imported by a script with command line arguments."""
    monkeypatch.setattr(sys, "argv", getattr(request, "param", _ARGUMENTS))
    with ros1_imports():
        import rospy

        yield rospy
    logging.getLogger("rosout").handlers.clear()


def _names(rospy: ModuleType) -> dict[str, Any]:
    from std_msgs.msg import String

    return {"rospy": rospy, "String": String, "early": rospy.Publisher("early", String, queue_size=1)}


def test_before_init_node(rospy: Any, capfd: pytest.CaptureFixture[str]) -> None:
    check(
        """
        rospy.Time.now() !! rospy.exceptions.ROSInitException: time is not initialized. Have you called init_node()?
        rospy.Rate(10) !! rospy.exceptions.ROSInitException: time is not initialized. Have you called init_node()?
        rospy.get_time() !! rospy.exceptions.ROSInitException: time is not initialized. Have you called init_node()?
        rospy.sleep(0.01) -> None
        rospy.spin() !! rospy.exceptions.ROSInitException: client code must call rospy.init_node() first
        rospy.get_name() -> '/unnamed'
        rospy.get_namespace() -> '/'
        rospy.is_shutdown() -> False
        rospy.resolve_name('a') -> '/a'
        rospy.resolve_name('~a') -> '/unnamed/a'
        type(rospy.Subscriber('s', String, lambda m: None)).__name__ -> 'Subscriber'
        rospy.Publisher('~p', String, queue_size=1) !! builtins.ValueError: ~name topics cannot be created before
            init_node() has been called
        early.publish('x') !! rospy.exceptions.ROSException: ROS node has not been initialized yet. Please call
            init_node() first
        (rospy.set_param('pre', 1), rospy.get_param('pre')) -> (None, 1)
        rospy.loginfo('early') -> None
        rospy.Publisher('cmd_vel', String, queue_size=1).resolved_name -> '/tb3_0/cmd_vel'
        """,
        _names(rospy),
    )
    assert capfd.readouterr().out == ""


def test_init_node_and_names(rospy: Any) -> None:
    rospy.init_node("probe")
    check(
        f"""
        rospy.init_node('probe') -> None
        rospy.init_node('other') !! rospy.exceptions.ROSException: rospy.init_node() has already been called with
            different arguments: ('probe', {_ARGUMENTS}, False, None, False, False)
        rospy.init_node('') !! builtins.ValueError: name must not be empty
        rospy.init_node('a/b') !! builtins.ValueError: namespaces are not allowed in node names
        rospy.get_name() -> '/probe'
        rospy.get_namespace() -> '/'
        rospy.get_caller_id() -> '/probe'
        rospy.resolve_name('a') -> '/a'
        rospy.resolve_name('/a') -> '/a'
        rospy.resolve_name('~a') -> '/probe/a'
        rospy.resolve_name('a/b') -> '/a/b'
        rospy.resolve_name('') -> '/'
        rospy.resolve_name('/') -> '/'
        rospy.resolve_name('~') -> '/probe/'
        rospy.resolve_name('a/') -> '/a'
        rospy.resolve_name('//a') -> '/a'
        rospy.resolve_name('a//b') -> '/a/b'
        rospy.resolve_name('~/a') -> '/a'
        rospy.myargv()[1:] -> ['plain_arg', '--opt', '3']
        rospy.get_param('~speed') -> 0.3
        rospy.get_param('~list') -> [1, 2]
        rospy.get_param('~text') -> 'hello'
        rospy.get_param('~flag') -> True
        rospy.resolve_name('cmd_vel') -> '/tb3_0/cmd_vel'
        rospy.resolve_name('odom') -> '/robot/odom'
        rospy.remap_name('odom') -> '/robot/odom'
        rospy.remap_name('scan') -> 'scan'
        """,
        {"rospy": rospy},
    )


@pytest.mark.parametrize("rospy", [["x.py", "__ns:=/a/b", "__name:=given", "in:=~out"]], indirect=True)
def test_names_of_the_command_line_win(rospy: Any) -> None:
    rospy.init_node("own", anonymous=True)
    check(
        """
        rospy.get_name() -> '/a/b/given'
        rospy.get_namespace() -> '/a/b/'
        rospy.resolve_name('in') -> '/a/b/given/out'
        rospy.resolve_name('') -> '/a/b/'
        """,
        {"rospy": rospy},
    )


@pytest.mark.parametrize("rospy", [["x.py"]], indirect=True)
def test_names_that_the_bus_does_not_take_are_cleaned(rospy: Any) -> None:
    from std_msgs.msg import String

    with pytest.warns(UserWarning, match="'Custom Rover 1' is not a legal ROS base name.*named 'Custom_Rover_1'"):
        rospy.init_node("Custom Rover 1")
    with pytest.warns(UserWarning, match="'left-wheel' is not a legal ROS graph resource name"):
        publisher = rospy.Publisher("left-wheel", String, queue_size=1)
    assert (rospy.get_name(), publisher.resolved_name) == ("/Custom_Rover_1", "/left-wheel")
    publisher.publish("x")
    assert kernel().wait_until(lambda: ["/left_wheel", "std_msgs/String"] in rospy.get_published_topics(), 60.0)


def test_anonymous_names_have_process_and_time(rospy: Any) -> None:
    rospy.init_node("talker", anonymous=True)
    assert re.fullmatch(r"/talker_\d+_\d{13}", rospy.get_name())


def test_parameters(rospy: Any) -> None:
    rospy.init_node("probe")
    rospy.set_param("gains", {"P": 1, "I": 2.5})
    check(
        """
        rospy.get_param('nope') !! builtins.KeyError: 'nope'
        rospy.get_param('nope', 3) -> 3
        rospy.get_param('nope', None) -> None
        rospy.get_param('gains') -> {'P': 1, 'I': 2.5}
        rospy.get_param('gains/P') -> 1
        rospy.has_param('gains/I') -> True
        rospy.search_param('gains') -> '/gains'
        rospy.search_param('speed') -> '/probe/speed'
        rospy.search_param('nope') -> None
        rospy.delete_param('gains/P') -> None
        rospy.delete_param('nope') !! builtins.KeyError: 'nope'
        (rospy.set_param('t', (1, 2)), rospy.get_param('t')) -> (None, [1, 2])
        rospy.set_param('n', None) !! builtins.TypeError: cannot marshal None unless allow_none is enabled
        rospy.set_param('n', [{'a': None}]) !! builtins.TypeError: cannot marshal None unless allow_none is enabled
        rospy.set_param('n', {1: 2}) !! builtins.TypeError: dictionary key must be string
        rospy.set_param('n', 2 ** 40) !! builtins.OverflowError: int exceeds XML-RPC limits
        rospy.set_param('n', {1, 2}) !! builtins.TypeError: cannot marshal <class 'set'> objects
        rospy.get_param('~') -> {'speed': 0.3, 'list': [1, 2], 'text': 'hello', 'flag': True}
        rospy.get_param_cached('t') -> [1, 2]
        sorted(rospy.get_param_names()) -> ['/gains/I', '/probe/flag', '/probe/list', '/probe/speed',
            '/probe/text', '/t']
        rospy.get_master().getParam('/t') -> (1, '', [1, 2])
        '~flag' in rospy.get_master() -> True
        """,
        {"rospy": rospy},
    )


def test_log_lines(rospy: Any, capfd: pytest.CaptureFixture[str]) -> None:
    rospy.init_node("probe")
    rospy.loginfo("plain")
    rospy.loginfo("%s %d", "args", 3)
    rospy.loginfo(3.5)
    rospy.loginfo({"a": 1})
    rospy.logwarn("w")
    rospy.logerr("e")
    rospy.logfatal("f")
    rospy.logdebug("hidden")
    for number in range(3):
        rospy.loginfo_throttle(60, f"throttled {number}")
        rospy.loginfo_once(f"once {number}")
        rospy.logwarn_throttle_identical(60, f"identical {number // 2}")
    rospy.loginfo("named", logger_name="part")
    captured = capfd.readouterr()
    plain = re.compile(r"\[\d{10}\.\d{6}\]")
    assert plain.sub("[t]", captured.out).splitlines() == [
        "[INFO] [t]: plain",
        "[INFO] [t]: args 3",
        "[INFO] [t]: 3.5",
        "[INFO] [t]: {'a': 1}",
        "[INFO] [t]: throttled 0",
        "[INFO] [t]: once 0",
        "[INFO] [t]: named",
    ]
    assert plain.sub("[t]", captured.err).splitlines() == [
        "[WARN] [t]: w",
        "[ERROR] [t]: e",
        "[FATAL] [t]: f",
        "[WARN] [t]: identical 0",
        "[WARN] [t]: identical 1",
    ]


def test_log_level_and_format(rospy: Any, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROSCONSOLE_FORMAT", "${severity} ${node} ${function}: ${message}")
    lines: list[tuple[int, str, Any]] = []
    monkeypatch.setattr(kernel(), "log", lambda level, text, where: lines.append((level, text, where["function"])))
    rospy.init_node("probe", log_level=rospy.DEBUG)
    rospy.logdebug("seen")
    assert capfd.readouterr().out == "DEBUG /probe test_log_level_and_format: seen\n"
    assert lines == [(rospy.DEBUG, "seen", "test_log_level_and_format")]


def test_the_level_is_set_by_a_service(rospy: Any, capfd: pytest.CaptureFixture[str]) -> None:
    from roscpp.srv import GetLoggers, SetLoggerLevel
    from rosgraph_msgs.msg import Log

    rospy.init_node("probe")
    heard: list[str] = []
    rospy.Subscriber("/rosout", Log, lambda line: heard.append(line.msg))
    set_level = rospy.ServiceProxy("~set_logger_level", SetLoggerLevel)
    loggers = rospy.ServiceProxy("~get_loggers", GetLoggers)

    def level(name: str) -> str:
        return next(each.level for each in loggers().loggers if each.name == name)

    rospy.loginfo("first", logger_name="part")
    assert (loggers().loggers[0].name, level("rosout"), level("rosout.part")) == ("rosout", "info", "info")
    rospy.logdebug("hidden")
    set_level("rosout", "DEBUG")
    rospy.logdebug("shown")
    assert (level("rosout"), level("rosout.part")) == ("debug", "debug")
    set_level("rosout", "error")
    rospy.logwarn("hidden")
    set_level("rosout.part", "info")
    rospy.loginfo("of a part", logger_name="part")
    rospy.logerr("last")
    for logger, wrong, text in (("rosout", "loud", "debug, info, warn"), ("roscout", "info", "rosout")):
        with pytest.raises(rospy.ServiceException, match=text):
            set_level(logger, wrong)
    wanted = ["first", "shown", "of a part", "last"]
    assert kernel().wait_until(lambda: heard == wanted, 60.0), heard
    said = capfd.readouterr()
    assert [line.rpartition(": ")[2] for line in said.out.splitlines()] == wanted[:3]
    assert said.err.count("last") == 1
    assert "hidden" not in said.err
    logging.getLogger("rosout.part").setLevel(logging.NOTSET)


def test_unknown_names_say_what_to_use(rospy: Any) -> None:
    check(
        """
        rospy.Pubisher !! builtins.AttributeError: module 'rospy' has no attribute 'Pubisher'; did you mean 'Publisher'?
        rospy.ok !! builtins.AttributeError: module 'rospy' has no attribute 'ok'; use not rospy.is_shutdown()
        rospy.Header().seq -> 0
        """,
        {"rospy": rospy},
    )


def test_a_publisher_without_queue_size_warns(rospy: Any) -> None:
    from std_msgs.msg import String

    with pytest.warns(SyntaxWarning, match="explicit keyword argument 'queue_size'"):
        rospy.Publisher("q", String)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rospy.Publisher("q", String, None, False, False, None, 10)
