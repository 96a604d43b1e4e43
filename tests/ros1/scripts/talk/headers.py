#!/usr/bin/env python
import rospy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

rospy.init_node("headers")
seen = []


def callback(msg):
    seen.append(msg._connection_header)


def serve(req):
    return TriggerResponse(True, req._connection_header["callerid"])


pub = rospy.Publisher("labelled", String, queue_size=1, latch=True, headers={"colour": "green"})
rospy.Subscriber("labelled", String, callback)
rospy.Service("who", Trigger, serve)
pub.publish("x")
rospy.sleep(1.0)
while not seen:
    rospy.sleep(0.05)
print("%s by %s, latching %s" % (seen[0]["type"], seen[0]["callerid"], seen[0].get("latching")))
print("colour %s" % seen[0].get("colour"))
print("asked by %s" % rospy.ServiceProxy("who", Trigger)().message)
print("peers %d %d" % (pub.get_num_connections(), len(String._md5sum)))
