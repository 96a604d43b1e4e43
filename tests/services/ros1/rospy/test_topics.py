"""Publishers, subscribers and services behave as in real rospy."""

import logging
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from services.script.api import kernel
from tests.harness.ros1 import ros1_imports
from tests.services.ros1.rospy.golden import check

WITHIN_S = 60.0


@pytest.fixture
def rospy(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setattr(sys, "argv", ["probe.py"])
    with ros1_imports():
        import rospy

        rospy.init_node("probe")
        yield rospy
    logging.getLogger("rosout").handlers.clear()


def _until(ready: Callable[[], bool]) -> None:
    assert kernel().wait_until(ready, WITHIN_S)


def _connected(rospy: Any, publisher: Any) -> None:
    _until(lambda: publisher.get_num_connections() > 0)


def test_what_publish_takes(rospy: Any) -> None:
    from std_msgs.msg import Empty, Float32, String

    got: list[Any] = []
    publisher = rospy.Publisher("probe_topic", Float32, queue_size=10)
    subscriber = rospy.Subscriber("probe_topic", Float32, lambda m: got.append((m, threading.current_thread().name)))
    _connected(rospy, publisher)
    empty = rospy.Publisher("e", Empty, queue_size=1)
    gone = rospy.Publisher("gone", Float32, queue_size=1)
    gone.unregister()
    check(
        """
        p.publish(1) -> None
        p.publish(data=2) -> None
        p.publish(Float32(3)) -> None
        p.publish('x') !! rospy.exceptions.ROSSerializationException: field data must be float type
        p.publish(1, 2) !! builtins.TypeError: Invalid number of arguments, args should be ['data'] args are(1, 2)
        p.publish(String('s')) !! builtins.TypeError: expected [float32] but got [std_msgs/String]
        p.publish([4]) !! rospy.exceptions.ROSSerializationException: field data must be float type
        p.publish({'data': 5}) !! rospy.exceptions.ROSSerializationException: field data must be float type
        p.publish(1, data=2) !! builtins.TypeError: publish() can be called with arguments or keywords, but not both.
        p.publish(speed=2) !! builtins.AttributeError: speed is not an attribute of Float32
        e.publish() -> None
        e.publish(Empty()) -> None
        gone.publish(1) !! rospy.exceptions.ROSException: publish() to an unregistered() handle
        rospy.Publisher('', Float32, queue_size=1) !! builtins.ValueError: topic name is not a non-empty string
        rospy.Publisher('x', 'Float32', queue_size=1) !! builtins.ValueError: data_class [Float32] is not a class
        rospy.Publisher('x', int, queue_size=1) !! builtins.ValueError: data_class [type] is not a message data class
        (p.get_num_connections(), s.get_num_connections()) -> (1, 1)
        """,
        {"rospy": rospy, "p": publisher, "s": subscriber, "e": empty, "gone": gone, "Float32": Float32}
        | {"String": String, "Empty": Empty},
    )
    _until(lambda: len(got) == 3)
    assert [(m.data, name) for m, name in got] == [(1.0, "/probe_topic"), (2.0, "/probe_topic"), (3.0, "/probe_topic")]
    assert got[0][0]._connection_header == {
        "callerid": "/probe",
        "latching": "0",
        "md5sum": "73fcbf46b49191e672908e50842a83d4",
        "message_definition": Float32._full_text,
        "topic": "/probe_topic",
        "type": "std_msgs/Float32",
    }


def test_callbacks_of_a_topic(rospy: Any, capfd: pytest.CaptureFixture[str]) -> None:
    from sensor_msgs.msg import JointState

    log: list[Any] = []

    def change(message: Any) -> None:
        message.name.append("x")
        log.append("first")

    def note(message: Any, place: Any) -> None:
        log.append((message.name, message.header.seq, place))

    def bad(message: Any) -> None:
        raise ValueError("boom")

    publisher = rospy.Publisher("a", JointState, queue_size=10)
    rospy.Subscriber("a", JointState, change)
    rospy.Subscriber("a", JointState, bad)
    several = [rospy.Subscriber("a", JointState, note, ("x", 1)) for _ in range(100)]
    rospy.Subscriber("a", JointState, note, "end")
    rospy.Subscriber("a", JointState)
    _connected(rospy, publisher)
    sent = JointState()
    publisher.publish(sent)
    publisher.publish(sent)
    _until(lambda: len(log) == 6)
    one, other = ["first", (["x"], 1, ("x", 1)), (["x"], 1, "end")], ["first", (["x"], 2, ("x", 1)), (["x"], 2, "end")]
    assert log == [*one, *other]
    assert sent.header.seq == 0
    assert capfd.readouterr().err.count("bad callback: <function test_callbacks_of_a_topic.<locals>.bad at 0x") == 2
    for each in several[:99]:
        each.unregister()
    publisher.publish(sent)
    _until(lambda: len(log) == 9)
    several[99].unregister()
    several[99].unregister()
    publisher.publish(sent)
    _until(lambda: len(log) == 11)
    assert log[9:] == ["first", (["x"], 4, "end")]


def test_latched_messages_and_wait_for_message(rospy: Any) -> None:
    from std_msgs.msg import Float32, String

    rospy.Publisher("latched", String, queue_size=1, latch=True).publish("L")
    for _ in range(2):
        assert rospy.wait_for_message("latched", String, timeout=WITHIN_S).data == "L"
    got: list[str] = []
    rospy.Subscriber("latched", String, lambda m: got.append(m.data))
    _until(lambda: got == ["L"])
    any_message = rospy.wait_for_message("latched", rospy.AnyMsg, timeout=WITHIN_S)
    assert any_message._buff == b"\x01\x00\x00\x00L"
    assert any_message._connection_header["type"] == "std_msgs/String"
    check(
        """
        rospy.wait_for_message('never', String, timeout=0.05) !! rospy.exceptions.ROSException: timeout exceeded while
            waiting for message on topic never
        rospy.wait_for_message('never', String, timeout=rospy.Duration(0.05)) !! rospy.exceptions.ROSException: timeout
            exceeded while waiting for message on topic never
        """,
        {"rospy": rospy, "String": String},
    )
    publisher = rospy.Publisher("later", Float32, queue_size=1)
    rospy.Timer(rospy.Duration(0.01), lambda event: publisher.publish(1))
    assert rospy.wait_for_message("later", Float32, WITHIN_S).data == 1.0


def test_numpy_messages_and_headers(rospy: Any) -> None:
    from rospy.numpy_msg import numpy_msg
    from rospy_tutorials.msg import Floats

    got: list[Any] = []
    publisher = rospy.Publisher("floats", numpy_msg(Floats), queue_size=1, headers={"cookies": "peanut butter"})
    rospy.Subscriber("floats", numpy_msg(Floats), got.append)
    _connected(rospy, publisher)
    import numpy

    publisher.publish(numpy.array([1.0, 2.5], dtype=numpy.float32))
    publisher.publish(data=[3.0])
    _until(lambda: len(got) == 2)
    assert (got[0].data * 2).tolist() == [2.0, 5.0]
    assert got[0].data.dtype == numpy.float32
    assert got[0]._connection_header["cookies"] == "peanut butter"

    from nav_msgs.msg import Odometry

    odometry: list[Any] = []
    sender = rospy.Publisher("odom", numpy_msg(Odometry), queue_size=2)
    rospy.Subscriber("odom", numpy_msg(Odometry), odometry.append)
    _connected(rospy, sender)
    sent = Odometry()
    sent.pose.covariance = [1.0] + [0.0] * 35
    sender.publish(sent)
    _until(lambda: len(odometry) == 1)
    assert odometry[0].pose.covariance.reshape(6, 6)[0, 0] == 1.0
    sender.publish(odometry[0])
    _until(lambda: len(odometry) == 2)
    assert odometry[1].pose.covariance.tolist() == list(sent.pose.covariance)


def test_listeners_learn_who_subscribes(rospy: Any) -> None:
    from std_msgs.msg import String

    events: list[Any] = []

    class Listener(rospy.SubscribeListener):
        def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
            events.append(("came", topic_name))
            peer_publish(String("welcome"))

        def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
            events.append(("went", topic_name, num_peers))

    got: list[str] = []
    rospy.Publisher("chatter", String, Listener(), queue_size=1)
    subscriber = rospy.Subscriber("chatter", String, lambda m: got.append(m.data))
    _until(lambda: got == ["welcome"])
    subscriber.unregister()
    _until(lambda: len(events) == 2)
    assert events == [("came", "/chatter"), ("went", "/chatter", 0)]


def test_services(rospy: Any, capfd: pytest.CaptureFixture[str]) -> None:
    from std_srvs.srv import Empty, EmptyResponse, SetBool, SetBoolRequest, SetBoolResponse

    def refuse(request: Any) -> Any:
        raise rospy.ServiceException("no")

    handlers: dict[str, Callable[[Any], Any]] = {
        "response": lambda request: SetBoolResponse(True, "m"),
        "list": lambda request: [True, "m"],
        "tuple": lambda request: (True, "m"),
        "dict": lambda request: {"success": True, "message": "m"},
        "none": lambda request: None,
        "bool": lambda request: True,
        "short": lambda request: [True],
        "fails": lambda request: 1 / 0,
        "refuses": refuse,
    }
    names: dict[str, Any] = {"rospy": rospy, "Empty": Empty, "SetBool": SetBool, "SetBoolRequest": SetBoolRequest}
    names |= {"S": EmptyResponse}
    for name, handler in handlers.items():
        rospy.Service(name, SetBool, handler)
        names[name] = rospy.ServiceProxy(name, SetBool)
    rospy.Service("em", Empty, lambda request: [])
    rospy.wait_for_service("refuses", WITHIN_S)
    arguments = "Invalid number of arguments, args should be"
    check(
        f"""
        response(True) -> success: True\\nmessage: "m"
        list(True) -> success: True\\nmessage: "m"
        tuple(True) -> success: True\\nmessage: "m"
        dict(True) -> success: True\\nmessage: "m"
        none(True) !! rospy.service.ServiceException: service [/none] responded with an error: b'service cannot process
            request: service handler returned None'
        bool(True) !! rospy.service.ServiceException: service [/bool] responded with an error: b"service cannot process
            request: handler returned invalid value: {arguments} ['success', 'message'] args are(True,)"
        short(True) !! rospy.service.ServiceException: service [/short] responded with an error: b"service cannot
            process request: handler returned wrong number of values: {arguments} ['success', 'message'] args
            are(True,)"
        fails(True) !! rospy.service.ServiceException: service [/fails] responded with an error: b'error processing
            request: division by zero'
        refuses(True) !! rospy.service.ServiceException: service [/refuses] responded with an error: b'service cannot
            process request: no'
        response(data=True) -> success: True\\nmessage: "m"
        response(SetBoolRequest(True)) -> success: True\\nmessage: "m"
        response.call(True) -> success: True\\nmessage: "m"
        response() -> success: True\\nmessage: "m"
        response(1, 2) !! builtins.TypeError: {arguments} ['data'] args are(1, 2)
        rospy.ServiceProxy('nosrv', Empty)() !! rospy.service.ServiceException: service [/nosrv] unavailable
        rospy.wait_for_service('nosrv', timeout=0.05) !! rospy.exceptions.ROSException: timeout exceeded while waiting
            for service /nosrv
        rospy.wait_for_service('nosrv', timeout=0) !! builtins.ValueError: timeout must be non-zero
        rospy.ServiceProxy('em', Empty, persistent=True)() ->\x20
        rospy.Service('em', Empty, lambda request: S()) !! rospy.service.ServiceException: service [/em] already
            registered
        (SetBool._type, SetBool._request_class.__name__) -> ('std_srvs/SetBool', 'SetBoolRequest')
        setattr(SetBool(), 'effort', 1) -> None
        """,
        names,
    )
    assert "Error processing request: division by zero\nTraceback" in capfd.readouterr().err
    headers: list[Any] = []

    def note(request: Any) -> Any:
        headers.append((request._connection_header["callerid"], request._connection_header["cookies"]))
        return EmptyResponse()

    service = rospy.Service("headers", Empty, note)
    response = rospy.ServiceProxy("headers", Empty, headers={"cookies": "oatmeal"})()
    assert response._connection_header["callerid"] == "/probe"
    with pytest.raises(rospy.ServiceException, match="md5sums do not match"):
        rospy.ServiceProxy("headers", SetBool)(True)
    assert headers == [("/probe", "oatmeal")]
    service.shutdown()
    service.spin()


def test_after_a_shutdown(rospy: Any) -> None:
    from std_msgs.msg import Float32, String
    from std_srvs.srv import Empty, EmptyResponse

    got: list[Any] = []
    publisher = rospy.Publisher("p", Float32, queue_size=1)
    rospy.Subscriber("p", Float32, lambda m: got.append(m.data))
    rospy.Service("em", Empty, lambda request: EmptyResponse())
    _connected(rospy, publisher)
    seen: list[Any] = []

    def stop() -> None:
        seen.append((rospy.is_shutdown(), publisher.publish(9)))
        _until(lambda: got == [9.0])

    rospy.on_shutdown(stop)
    rospy.on_shutdown(lambda: 1 / 0)
    rospy.on_shutdown(lambda: seen.append("last"))
    rospy.signal_shutdown("enough")
    assert seen == [(False, None), "last"]
    check(
        """
        rospy.is_shutdown() -> True
        p.publish(1) -> None
        rospy.sleep(0.01) -> None
        rospy.Rate(100).sleep() -> None
        rospy.wait_for_message('x', String) !! rospy.exceptions.ROSInterruptException: rospy shutdown
        rospy.wait_for_service('x') !! rospy.exceptions.ROSInterruptException: rospy shutdown
        rospy.ServiceProxy('em', Empty)() !! rospy.service.ServiceException: service [/em] unavailable
        rospy.spin() -> None
        rospy.loginfo('late') -> None
        """,
        {"rospy": rospy, "p": publisher, "String": String, "Empty": Empty},
    )
