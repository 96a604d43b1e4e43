#!/usr/bin/env python
import rospy
from gazebo_msgs.msg import ModelState, ModelStates
from gazebo_msgs.srv import GetModelState, GetWorldProperties, SetModelState

latest = None


def states(msg):
    global latest
    latest = msg


def ball():
    return latest.pose[latest.name.index("ball")].position.x if latest is not None else 0.0


rospy.init_node("model_state")
rospy.Subscriber("/gazebo/model_states", ModelStates, states)
rospy.wait_for_service("/gazebo/set_model_state")
set_state = rospy.ServiceProxy("/gazebo/set_model_state", SetModelState)
get_state = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)
where = get_state("ball", "world")
print("ball %s at %.1f" % (where.success, where.pose.position.x))
state = ModelState()
state.model_name = "ball"
state.pose.position.x = 1.5
state.pose.position.z = 0.12
state.pose.orientation.w = 1.0
state.reference_frame = "world"
try:
    resp = set_state(state)
except rospy.ServiceException as e:
    print("Service call failed: %s" % e)
while round(ball(), 1) != 1.5:
    rospy.sleep(0.05)
print("set %s, now %.1f" % (resp.success, ball()))
print("nobody: %s" % get_state("nobody", "").success)
print("world knows %s" % sorted(rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)().model_names))
pub = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
while pub.get_num_connections() == 0:
    rospy.sleep(0.05)
for i in range(5):
    state.pose.position.x = 1.5 + 0.1 * i
    pub.publish(state)
    rospy.sleep(0.1)
while round(get_state("ball", "").pose.position.x, 1) != 1.9:
    rospy.sleep(0.05)
print("by topic %.1f" % get_state("ball", "").pose.position.x)
