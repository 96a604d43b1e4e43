#!/usr/bin/env python
import rospy
from nav_msgs.msg import OccupancyGrid


class MapReader:
    def __init__(self):
        rospy.init_node("map_reader")
        rospy.sleep(1.0)
        rospy.Subscriber("drawn_map", OccupancyGrid, self.on_map)

    def on_map(self, grid):
        walls = sum(1 for c in grid.data if c == 100)
        unknown = sum(1 for c in grid.data if c < 0)
        print("map %dx%d, %d walls, %d unknown, %s" % (grid.info.width, grid.info.height, walls, unknown, type(grid.data).__name__))
        rospy.signal_shutdown("have it")

    def spin(self):
        rospy.spin()


if __name__ == "__main__":
    MapReader().spin()
