#!/usr/bin/env python
import rospy
from std_srvs.srv import Empty, SetBool, SetBoolRequest, Trigger

rospy.init_node("services_client")
for name in ("switch", "as_dict", "as_list", "failing", "nothing", "empty"):
    rospy.wait_for_service("/services/" + name, timeout=300.0)
switch = rospy.ServiceProxy("/services/switch", SetBool)
print(switch(True).message, switch(data=False).message, switch(SetBoolRequest(True)).message)
reply = rospy.ServiceProxy("/services/as_dict", Trigger)()
print(reply.success, reply.message)
print(rospy.ServiceProxy("/services/as_list", Trigger)().message)
print(repr(rospy.ServiceProxy("/services/empty", Empty)()))
for name in ("failing", "nothing", "missing"):
    try:
        rospy.ServiceProxy("/services/" + name, Trigger)()
    except rospy.ServiceException as error:
        print("%s: %s" % (name, error))
try:
    rospy.wait_for_service("/services/missing", timeout=0.5)
except rospy.ROSException as error:
    print("wait: %s" % error)
