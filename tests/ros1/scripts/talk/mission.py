#!/usr/bin/env python
import actionlib
import rospy
import smach
import smach_ros
from actionlib_tutorials.msg import FibonacciAction, FibonacciResult
from std_msgs.msg import Bool


class Charge(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=["charging", "full"], input_keys=["level"], output_keys=["level"])

    def execute(self, userdata):
        rospy.sleep(0.2)
        userdata.level += 40
        return "full" if userdata.level >= 100 else "charging"


class Beat(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=["preempted"])

    def execute(self, userdata):
        beats = 0
        while not self.preempt_requested():
            beats += 1
            rospy.sleep(0.1)
        self.service_preempt()
        print("beats %s" % (beats > 1))
        return "preempted"


def count(goal):
    rospy.sleep(0.1 * goal.order)
    server.set_succeeded(FibonacciResult(list(range(goal.order))))


rospy.init_node("mission")
server = actionlib.SimpleActionServer("~count", FibonacciAction, count, False)
server.start()
door = rospy.Publisher("~door", Bool, queue_size=1)
rospy.Timer(rospy.Duration(0.25), lambda event: door.publish(rospy.get_time() < 2.0))

top = smach.StateMachine(outcomes=["done", "failed"])
top.userdata.level = 0
top.userdata.order = 5
with top:
    smach.StateMachine.add("CHARGE", Charge(), transitions={"charging": "CHARGE", "full": "WORK"})
    work = smach.Concurrence(
        outcomes=["worked", "idle"],
        default_outcome="idle",
        input_keys=["order"],
        output_keys=["sequence"],
        outcome_map={"worked": {"COUNT": "succeeded"}},
        child_termination_cb=lambda outcomes: outcomes["COUNT"] is not None,
    )
    with work:
        smach.Concurrence.add("BEAT", Beat())
        smach.Concurrence.add(
            "COUNT",
            smach_ros.SimpleActionState(
                "mission/count", FibonacciAction, goal_slots=["order"], result_slots=["sequence"]
            ),
        )
    smach.StateMachine.add("WORK", work, transitions={"worked": "DOOR", "idle": "failed"})
    smach.StateMachine.add(
        "DOOR",
        smach_ros.MonitorState("mission/door", Bool, lambda userdata, message: message.data),
        transitions={"invalid": "done", "valid": "failed", "preempted": "failed"},
    )
shown = smach_ros.IntrospectionServer("mission", top, "/MISSION")
shown.start()
print("%s at level %d with %s" % (top.execute(), top.userdata.level, list(top.userdata.sequence)))
shown.stop()
