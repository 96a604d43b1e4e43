#!/usr/bin/env python
import rospy
from campus_interfaces.msg import *


class Monitor:
    def __init__(self):
        rospy.init_node("monitor")
        self.limit = rospy.get_param("~limit", 6)
        self.rooms, self.faulty, self.total = {}, 0, 0.0
        self.sub = rospy.Subscriber("readings", Reading, self.on_reading)

    def on_reading(self, msg):
        self.rooms[msg.room] = self.rooms.get(msg.room, 0) + 1
        self.faulty += msg.status == Reading.FAULTY
        self.total += sum(s.real + s.imaginary for s in msg.samples) - msg.axes[0]
        if sum(self.rooms.values()) == self.limit:
            print("rooms %s" % sorted(self.rooms.items()))
            print("faulty %d, total %.2f, unit %s" % (self.faulty, self.total, Reading.UNIT))
            print("took %.3f, %s" % (msg.took.to_sec(), type(msg.axes).__name__))
            self.sub.unregister()


if __name__ == "__main__":
    Monitor()
    rospy.spin()
