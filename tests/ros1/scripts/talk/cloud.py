#!/usr/bin/env python
import struct

import rospy
import sensor_msgs.point_cloud2 as pc2
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

rospy.init_node("cloud")
pub = rospy.Publisher("cloud", PointCloud2, queue_size=2, latch=True)
points = []
for x in range(4):
    for y in range(2):
        rgb = struct.unpack("I", struct.pack("BBBB", 10 * x, 20, 30, 255))[0]
        points.append([float(x), float(y), 0.5, rgb])
fields = [
    PointField("x", 0, PointField.FLOAT32, 1),
    PointField("y", 4, PointField.FLOAT32, 1),
    PointField("z", 8, PointField.FLOAT32, 1),
    PointField("rgba", 12, PointField.UINT32, 1),
]
header = Header(frame_id="map")
pub.publish(pc2.create_cloud(header, fields, points))
msg = rospy.wait_for_message("cloud", PointCloud2)
back = list(pc2.read_points(msg, field_names=("x", "y", "z"), skip_nans=True))
print("%d points of %d bytes, far %s" % (msg.width, msg.point_step, back[-1]))
print("plain %d" % len(list(pc2.read_points(pc2.create_cloud_xyz32(header, [(1, 2, 3), (4, 5, 6)])))))
