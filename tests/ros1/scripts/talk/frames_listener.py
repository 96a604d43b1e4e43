#!/usr/bin/env python
import math

import rospy
import tf
from geometry_msgs.msg import PointStamped

if __name__ == "__main__":
    rospy.init_node("frames_listener")
    listener = tf.TransformListener()
    rate = rospy.Rate(10.0)
    tries = 0
    while not rospy.is_shutdown():
        try:
            (trans, rot) = listener.lookupTransform("/room", "/lamp", rospy.Time(0))
        except (tf.LookupException, tf.ConnectivityException, tf.ExtrapolationException):
            tries += 1
            rate.sleep()
            continue
        break
    print("lamp at %s, yaw %.4f" % ([round(v, 3) for v in trans], tf.transformations.euler_from_quaternion(rot)[2]))
    listener.waitForTransform("room", "fly", rospy.Time(), rospy.Duration(60.0))
    (trans, rot) = listener.lookupTransform("room", "fly", rospy.Time(0))
    print("fly at distance %.3f" % math.hypot(trans[0], trans[1]))
    point = PointStamped()
    point.header.frame_id = "lamp"
    point.point.x = 1.0
    moved = listener.transformPoint("room", point)
    print("point %.2f %.2f %.2f" % (moved.point.x, moved.point.y, moved.point.z))
    for at, name in ((rospy.Time(0), "nowhere"), (rospy.Time.now() + rospy.Duration(30), "fly")):
        try:
            listener.lookupTransform("room", name, at)
        except tf.ExtrapolationException:
            print("not yet")
        except tf.LookupException as error:
            print("unknown: %s" % ("nowhere" in str(error)))
    rospy.sleep(0.5)
    past = rospy.Time.now() - rospy.Duration(0.3)
    listener.waitForTransformFull("fly", rospy.Time(0), "fly", past, "room", rospy.Duration(60.0))
    (trans, rot) = listener.lookupTransformFull("fly", rospy.Time(0), "fly", past, "room")
    print("fly moved %.2f in about 0.3 s" % math.hypot(trans[0], trans[1]))
    print("frames %s" % [listener.frameExists(f) for f in ("room", "desk", "attic")])
