#!/usr/bin/env python
import rospy
from std_srvs.srv import SetBool, Trigger, TriggerRequest

rospy.init_node("move_client")
rospy.wait_for_service("move_in_circle")
curl = rospy.ServiceProxy("move_service/curl", SetBool)
print(curl(True).message)
move = rospy.ServiceProxy("move_in_circle", Trigger)
began = rospy.get_time()
result = move(TriggerRequest())
print(result.message)
print("took %.0f s" % (rospy.get_time() - began))
