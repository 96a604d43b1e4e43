#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

rospy.init_node("markers")
pub = rospy.Publisher("visualization_marker", Marker, queue_size=1, latch=True)
array_pub = rospy.Publisher("visualization_marker_array", MarkerArray, queue_size=1, latch=True)
marker = Marker()
marker.header.frame_id = "/odom"
marker.type = Marker.LINE_STRIP
marker.action = Marker.ADD
marker.scale.x = 0.05
marker.color = ColorRGBA(1.0, 0.5, 0.0, 1.0)
marker.pose.orientation.w = 1.0
marker.lifetime = rospy.Duration()
for i in range(5):
    marker.points.append(Point(i, i * i, 0))
pub.publish(marker)
array = MarkerArray()
for i in range(3):
    array.markers.append(Marker(id=i, type=Marker.SPHERE, ns="balls"))
array_pub.publish(array)
rospy.sleep(0.5)
got = rospy.wait_for_message("visualization_marker", Marker, timeout=60)
print("%d points, type %d, last %.1f" % (len(got.points), got.type, got.points[-1].y))
print([m.id for m in rospy.wait_for_message("visualization_marker_array", MarkerArray, 60).markers])
