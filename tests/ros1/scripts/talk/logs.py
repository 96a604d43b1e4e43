#!/usr/bin/env python
import rospy
from rosgraph_msgs.msg import Log

lines = []


def rosout(msg):
    if msg.name == "/logs" and msg.msg.startswith("log:"):
        lines.append((msg.level, msg.msg[4:]))


rospy.init_node("logs", log_level=rospy.INFO)
rospy.Subscriber("/rosout", Log, rosout)
rospy.sleep(0.5)
rospy.logdebug("log:hidden")
rospy.loginfo("log:info %d", 1)
rospy.logwarn("log:warn")
rospy.logerr("log:error")
rospy.logfatal("log:fatal")
for i in range(3):
    rospy.loginfo_once("log:once")
    rospy.logwarn_throttle(100, "log:throttled")
while len(lines) < 6:
    rospy.sleep(0.05)
rospy.sleep(0.5)
for level, text in lines:
    print(level, text)
