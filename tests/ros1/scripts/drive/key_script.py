#!/usr/bin/env python
import rospy
from std_msgs.msg import String

rospy.init_node("key_script")
pub = rospy.Publisher("keys", String, queue_size=1)
while pub.get_num_connections() < 1:
    rospy.sleep(0.1)
for key, pause in (("w", 4.0), ("a", 2.0), ("q", 0.5), ("s", 1.0)):
    pub.publish(key)
    rospy.sleep(pause)
print("keys sent")
