#!/usr/bin/env python
from math import sin

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header


def main():
    pub = rospy.Publisher("desk_joints", JointState, queue_size=10)
    rospy.init_node("joints")
    rate = rospy.Rate(10)
    js = JointState()
    js.header = Header()
    js.name = ["base", "elbow"]
    js.velocity = []
    js.effort = []
    for i in range(30):
        js.header.stamp = rospy.Time.now()
        js.position = [sin(0.1 * i), 0.5]
        pub.publish(js)
        rate.sleep()
    print(js)


if __name__ == "__main__":
    try:
        main()
    except rospy.ROSInterruptException:
        pass
