#!/usr/bin/env python
import math

import rospy
import tf

if __name__ == "__main__":
    rospy.init_node("frames")
    br = tf.TransformBroadcaster()
    rate = rospy.Rate(20)
    while not rospy.is_shutdown():
        t = rospy.Time.now().to_sec()
        br.sendTransform(
            (2.0, 0.0, 0.5), tf.transformations.quaternion_from_euler(0, 0, math.pi / 2), rospy.Time.now(), "desk", "room"
        )
        br.sendTransform((0.0, 1.0, 0.0), (0, 0, 0, 1), rospy.Time.now(), "lamp", "desk")
        br.sendTransform((math.sin(t), math.cos(t), 0), (0, 0, 0, 1), rospy.Time.now(), "fly", "room")
        rate.sleep()
