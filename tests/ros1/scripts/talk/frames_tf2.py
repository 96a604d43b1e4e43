#!/usr/bin/env python
import rospy
import tf2_geometry_msgs
import tf2_ros
from geometry_msgs.msg import TransformStamped

rospy.init_node("frames_tf2")
fixed = tf2_ros.StaticTransformBroadcaster()
t = TransformStamped()
t.header.stamp = rospy.Time.now()
t.header.frame_id = "room"
t.child_frame_id = "shelf"
t.transform.translation.x = 4.0
t.transform.rotation.z = 1.0
fixed.sendTransform(t)

buf = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buf)
rate = rospy.Rate(10)
while not rospy.is_shutdown():
    try:
        trans = buf.lookup_transform("shelf", "desk", rospy.Time())
        break
    except (tf2_ros.LookupException, tf2_ros.ConnectivityException, tf2_ros.ExtrapolationException):
        rate.sleep()
print("desk in shelf: %.2f %.2f" % (trans.transform.translation.x, trans.transform.translation.y))
pose = tf2_geometry_msgs.PoseStamped()
pose.header.frame_id = "desk"
pose.pose.orientation.w = 1.0
pose.pose.position.x = 1.0
out = buf.transform(pose, "shelf", rospy.Duration(1.0))
print("pose %.2f %.2f in %s" % (out.pose.position.x, out.pose.position.y, out.header.frame_id))
print("can %s %s" % (buf.can_transform("room", "lamp", rospy.Time()), buf.can_transform("room", "nowhere", rospy.Time())))
try:
    buf.lookup_transform("/room", "desk", rospy.Time())
except tf2_ros.TransformException as error:
    print(type(error).__name__)
mover = tf2_ros.TransformBroadcaster()
for i in range(10):
    t.header.stamp = rospy.Time.now()
    t.child_frame_id = "cart"
    t.transform.translation.x = 0.1 * i
    mover.sendTransform(t)
    rospy.sleep(0.05)
while not buf.can_transform("room", "cart", t.header.stamp):
    rospy.sleep(0.05)
print("cart at %.1f" % buf.lookup_transform("room", "cart", rospy.Time(0)).transform.translation.x)
