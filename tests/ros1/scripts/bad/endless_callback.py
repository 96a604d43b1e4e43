#!/usr/bin/env python
import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int32

rospy.init_node("endless_callback")
pub = rospy.Publisher("alive", Int32, queue_size=1)
ticks = 0


def stuck(msg):
    while True:
        pass


rospy.Subscriber("alive", Int32, stuck)
while not rospy.is_shutdown():
    pub.publish(ticks)
    ticks += 1
    if ticks == 20:
        print("main goes on")
    rospy.sleep(0.1)
