#!/usr/bin/env python
import signal

import rospy
from std_msgs.msg import Int32

ends = []


def handler(signum, frame):
    ends.append(signum)
    rospy.signal_shutdown("signal %d" % signum)


rospy.init_node("own_signals", disable_signals=True)
signal.signal(signal.SIGINT, handler)
signal.signal(signal.SIGTERM, handler)
print("mine: %s" % (signal.getsignal(signal.SIGINT) is handler))
pub = rospy.Publisher("pulse", Int32, queue_size=1)
beat = 0
while not rospy.is_shutdown():
    beat += 1
    pub.publish(beat)
    rospy.sleep(0.1)
    if beat == 8:
        rospy.signal_shutdown("eight")
print("beats %d" % beat)
