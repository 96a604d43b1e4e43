#!/usr/bin/env python
import threading

import rospy
from std_msgs.msg import Int32

rospy.init_node("free_threads")
pub = rospy.Publisher("counted", Int32, queue_size=1)


def count():
    for i in range(20):
        pub.publish(i)


for i in range(10):
    t = threading.Thread(target=count)
    t.daemon = True
    t.start()
raise ValueError("the main thread fails")
