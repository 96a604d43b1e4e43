"""smach and smach_ros: outcomes, data, preemption, and states for actions, services and topics."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module", autouse=True)
def kernel() -> Iterator[ScriptKernel]:
    with ros1_imports() as made:
        import rospy
        import smach_ros  # noqa: F401 - from here on smach logs as rospy does

        rospy.init_node("machines", disable_signals=True)
        yield made


def state(result: Any, outcomes: tuple[str, ...] = ("done",), **keys: Any) -> Any:
    """Return a state with a fixed outcome, or with the outcome of a function of its userdata."""
    import smach

    return smach.CBState(lambda ud: result(ud) if callable(result) else result, outcomes=list(outcomes), **keys)


def test_states_run_in_turn_and_hand_data_on(capfd: pytest.CaptureFixture[str]) -> None:
    import smach

    def count(ud: Any) -> str:
        ud.total = ud.number + 1
        return "more" if ud.number < 2 else "enough"

    class Say(smach.State):
        def __init__(self) -> None:
            smach.State.__init__(self, outcomes=["said"], input_keys=["text"])

        def execute(self, userdata: Any) -> str:
            said.append((userdata.text, "text" in userdata, "total" in userdata))
            return "said"

    said: list[Any] = []
    machine = smach.StateMachine(outcomes=["finished"])
    machine.userdata.n = 0
    with machine:
        smach.StateMachine.add(
            "COUNT",
            state(count, ("more", "enough"), input_keys=["number"], output_keys=["total"]),
            transitions={"more": "COUNT", "enough": "SAY"},
            remapping={"number": "n", "total": "n"},
        )
        smach.StateMachine.add("SAY", Say(), {"said": "finished"}, {"text": "n"})
    seen: list[Any] = []
    machine.register_transition_cb(lambda ud, active, word: seen.append((active, word)), ["on"])
    machine.register_termination_cb(lambda ud, ended, outcome: seen.append((ended, outcome)))
    assert machine.execute() == "finished"
    assert (machine.userdata.n, said, machine.is_running()) == (2, [(2, True, False)], False)
    assert seen == [(["COUNT"], "on"), (["SAY"], "on"), (["SAY"], "finished")]
    logged = capfd.readouterr().out
    assert "State machine starting in initial state 'COUNT' with userdata" in logged
    assert "State machine transitioning 'COUNT':'enough'-->'SAY'" in logged
    assert "State machine terminating 'SAY':'said':'finished'" in logged


def test_machines_nest_and_follow_in_sequence() -> None:
    import smach

    @smach.cb_interface(outcomes=["ok"], input_keys=["a"], output_keys=["b"])
    def double(ud: Any) -> str:
        ud.b = 2 * ud.a
        return "ok"

    inner = smach.Sequence(outcomes=["ok", "failed"], connector_outcome="ok", input_keys=["a"], output_keys=["b"])
    with inner:
        smach.Sequence.add("FIRST", smach.CBState(double))
        smach.Sequence.add("SECOND", smach.CBState(double), remapping={"a": "b"})
    outer = smach.StateMachine(["over", "failed"])
    outer.userdata.start = 1
    with outer:
        smach.StateMachine.add_auto("BEGIN", state("done"), ["done"])
        mapped = {"a": "start", "b": "end"}
        smach.StateMachine.add("TWICE", inner, {"ok": "over", "failed": ""}, mapped, constants={"start": 3})
    assert outer.execute() == "over"
    assert outer.userdata.end == 12
    assert sorted(outer.get_internal_edges()) == [
        ("done", "BEGIN", "TWICE"),
        ("failed", "TWICE", "failed"),
        ("ok", "TWICE", "over"),
    ]


def test_an_iterator_runs_its_state_for_each_item() -> None:
    import smach

    def check(ud: Any) -> str:
        found.append(ud.number)
        return "stop" if ud.number == ud.limit else "continue"

    for limit, outcome, numbers in ((9, "all", [1, 2, 3]), (2, "halted", [1, 2])):
        found: list[int] = []
        loop = smach.Iterator(
            ["all", "halted"], [], [], it=lambda: range(1, 4), it_label="number", exhausted_outcome="all"
        )
        loop.userdata.limit = limit
        with loop:
            smach.Iterator.set_contained_state(
                "CHECK",
                state(check, ("continue", "stop"), input_keys=["number", "limit"]),
                loop_outcomes=["continue"],
                final_outcome_map={"stop": "halted"},
            )
        assert (loop.execute(), found) == (outcome, numbers)


def test_states_run_beside_each_other(kernel: ScriptKernel) -> None:
    import smach

    def wait(ud: Any) -> str:
        kernel.wait_until(lambda: slow.preempt_requested())
        slow.service_preempt()
        ud.word = "asked"
        return "preempted"

    slow = state(wait, ("preempted", "done"), output_keys=["word"])
    both = smach.Concurrence(
        outcomes=["first", "neither"],
        default_outcome="neither",
        output_keys=["word"],
        outcome_map={"first": {"QUICK": "done", "SLOW": "preempted"}},
        child_termination_cb=lambda outcomes: outcomes["QUICK"] == "done",
    )
    with both:
        smach.Concurrence.add("QUICK", state("done"))
        smach.Concurrence.add("SLOW", slow)
    machine = smach.StateMachine(["first", "neither"])
    with machine:
        smach.StateMachine.add("BOTH", both)
    assert (machine.execute(), machine.userdata.word) == ("first", "asked")
    failing = smach.Concurrence(["done"], "done", outcome_cb=lambda outcomes: outcomes["ONE"])
    with failing:
        smach.Concurrence.add("ONE", state(lambda ud: 1 / 0))
    with pytest.raises(smach.InvalidStateError, match="A concurrent state raised an exception"):
        failing.execute()


def test_a_machine_that_is_preempted_asks_its_state(kernel: ScriptKernel) -> None:
    import smach

    class Patrol(smach.State):
        def __init__(self) -> None:
            smach.State.__init__(self, outcomes=["there", "preempted"])

        def execute(self, userdata: Any) -> str:
            begun.set()
            kernel.wait_until(self.preempt_requested)
            self.service_preempt()
            return "preempted"

    begun, outcomes = threading.Event(), []
    machine = smach.StateMachine(["preempted"])
    with machine:
        smach.StateMachine.add("PATROL", Patrol(), {"there": "PATROL"})
    thread = threading.Thread(target=lambda: outcomes.append(machine.execute()))
    thread.start()
    assert begun.wait(60)
    assert machine.get_active_states() == ["PATROL"]
    machine.request_preempt()
    kernel.wake()
    thread.join(60)
    assert (outcomes, machine.preempt_requested()) == (["preempted"], False)


def test_what_is_wrong_is_said(capfd: pytest.CaptureFixture[str]) -> None:
    import smach

    machine = smach.StateMachine(["end"])
    with machine:
        smach.StateMachine.add("A", state("done"), {"done": "B"})
        for label, kind, transitions in (
            ("A", smach.InvalidStateError, {"done": "end"}),
            ("C", smach.InvalidTransitionError, {"over": "end"}),
        ):
            with pytest.raises(kind):
                smach.StateMachine.add(label, state("done"), transitions)
    assert machine.execute() is None
    assert "State 'A' references unknown states: ['B']" in capfd.readouterr().err
    with pytest.raises(smach.InvalidStateError, match="no container is opened"):
        smach.StateMachine.add("A", state("done"))
    for broken, error in (
        (state("other"), (smach.InvalidTransitionError, "Attempted to return outcome 'other' from state 'S'")),
        (state(lambda ud: ud.secret), (smach.InvalidUserCodeError, "declared as input to this state")),
        (state(lambda ud: setattr(ud, "x", 1)), (smach.InvalidUserCodeError, "declared as output from this state")),
        (state(lambda ud: 1 / 0), (smach.InvalidUserCodeError, "division by zero")),
    ):
        faulty = smach.StateMachine(["done"])
        with faulty:
            smach.StateMachine.add("S", broken)
        with pytest.raises(error[0], match=error[1]):
            faulty.execute()
        assert not faulty.is_running()


def test_states_for_actions_services_topics_and_conditions() -> None:
    import actionlib
    import rospy
    import smach
    import smach_ros
    from actionlib.msg import TestAction, TestGoal, TestResult
    from std_msgs.msg import Int32
    from std_srvs.srv import SetBool, SetBoolResponse

    def execute(goal: Any) -> None:
        server.set_succeeded(TestResult(goal.goal + 1)) if goal.goal < 9 else server.set_aborted()

    server = actionlib.SimpleActionServer("count", TestAction, execute, False)
    server.start()
    rospy.Service("switch", SetBool, lambda request: SetBoolResponse(request.data, "on"))
    numbers = rospy.Publisher("numbers", Int32, latch=True, queue_size=1)
    numbers.publish(5)
    machine = smach.StateMachine(["won", "lost", "preempted"])
    machine.userdata.goal = 3
    machine.userdata.big = TestGoal(9)

    def after(ud: Any, status: int, result: Any) -> str | None:
        return "again" if result.result == 4 else None

    lost = {"aborted": "lost"}
    with machine:
        smach.StateMachine.add(
            "COUNT",
            smach_ros.SimpleActionState(
                "count", TestAction, goal_slots=["goal"], result_slots=["result"], result_cb=after, outcomes=["again"]
            ),
            {"succeeded": "lost", "again": "SWITCH", **lost},
        )
        smach.StateMachine.add(
            "SWITCH",
            smach_ros.ServiceState(
                "switch",
                SetBool,
                request_cb=lambda ud, request: setattr(request, "data", ud.result == 4),
                input_keys=["result"],
                response_slots=["message", "success"],
            ),
            {"succeeded": "WATCH", **lost},
        )
        smach.StateMachine.add(
            "WATCH",
            smach_ros.MonitorState("numbers", Int32, lambda ud, message: message.data < 5, max_checks=1),
            {"valid": "lost", "invalid": "ASK"},
        )
        smach.StateMachine.add(
            "ASK",
            smach_ros.ConditionState(lambda ud: ud.message == "on", input_keys=["message"]),
            {"true": "FAIL", "false": "lost"},
        )
        smach.StateMachine.add(
            "FAIL",
            smach_ros.SimpleActionState("count", TestAction, goal_key="big", exec_timeout=rospy.Duration(60)),
            {"succeeded": "lost", "aborted": "won"},
        )
    shown = smach_ros.IntrospectionServer("shown", machine, "/ROOT")
    shown.start()
    assert machine.execute() == "won"
    assert (machine.userdata.result, machine.userdata.message, machine.userdata.success) == (4, "on", True)
    shown.stop()
    server.action_server.stop()


def test_a_machine_is_an_action_server(kernel: ScriptKernel) -> None:
    import actionlib
    import rospy
    import smach
    import smach_ros
    from actionlib.msg import TestAction, TestGoal

    def work(ud: Any) -> str:
        if ud.goal < 0:
            kernel.wait_until(worker.preempt_requested)
            worker.service_preempt()
            return "preempted"
        ud.result = 10 * ud.goal
        return "done"

    worker = state(work, ("done", "preempted"), input_keys=["goal"], output_keys=["result"])
    machine = smach.StateMachine(["done", "preempted"], input_keys=["goal"])
    with machine:
        smach.StateMachine.add("WORK", worker)
    served = smach_ros.ActionServerWrapper(
        "work",
        TestAction,
        machine,
        succeeded_outcomes=["done"],
        preempted_outcomes=["preempted"],
        expand_goal_slots=True,
        pack_result_slots=True,
    )
    served.run_server()
    client = actionlib.SimpleActionClient("work", TestAction)
    assert client.wait_for_server(rospy.Duration(60))
    assert client.send_goal_and_wait(TestGoal(4), rospy.Duration(60)) == actionlib.GoalStatus.SUCCEEDED
    assert client.get_result().result == 40
    client.send_goal(TestGoal(-1))
    assert kernel.wait_until(machine.is_running, 60)
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(60))
    assert client.get_state() == actionlib.GoalStatus.PREEMPTED
    served._action_server.action_server.stop()
