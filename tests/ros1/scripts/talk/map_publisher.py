#!/usr/bin/env python
import rospy
from nav_msgs.msg import MapMetaData, OccupancyGrid

rospy.init_node("map_publisher")
pub = rospy.Publisher("/drawn_map", OccupancyGrid, queue_size=1, latch=True)
grid = OccupancyGrid()
grid.header.frame_id = "map"
grid.info = MapMetaData(width=20, height=10, resolution=0.05)
grid.info.origin.orientation.w = 1
cells = [-1] * 200
for i in range(20):
    cells[i] = 100
grid.data = cells
pub.publish(grid)
rospy.spin()
