#!/usr/bin/env python
import math

import geometry_msgs.msg
import rospy
import tf
import turtlesim.srv

if __name__ == "__main__":
    rospy.init_node("follower")
    listener = tf.TransformListener()
    rospy.wait_for_service("spawn")
    spawner = rospy.ServiceProxy("spawn", turtlesim.srv.Spawn)
    spawner(4, 2, 0, "turtle2")
    turtle_vel = rospy.Publisher("turtle2/cmd_vel", geometry_msgs.msg.Twist, queue_size=1)
    rate = rospy.Rate(10.0)
    distances = []
    while not rospy.is_shutdown() and (len(distances) < 50 or distances[-1] >= 0.5 * distances[0]):
        try:
            (trans, rot) = listener.lookupTransform("/turtle2", "/turtle1", rospy.Time(0))
        except (tf.LookupException, tf.ConnectivityException, tf.ExtrapolationException):
            continue
        angular = 4 * math.atan2(trans[1], trans[0])
        linear = 0.5 * math.sqrt(trans[0] ** 2 + trans[1] ** 2)
        cmd = geometry_msgs.msg.Twist()
        cmd.linear.x = linear
        cmd.angular.z = angular
        turtle_vel.publish(cmd)
        distances.append(linear * 2)
        rate.sleep()
    print("came nearer: %s" % (distances[-1] < 0.5 * distances[0]))
