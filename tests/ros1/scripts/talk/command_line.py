#!/usr/bin/env python3
import argparse
import sys

import rospy
from std_msgs.msg import String


class Publisher:
    def __init__(self):
        cli = argparse.ArgumentParser(description="Publishes a colour.")
        cli.add_argument("-colour", metavar="COL", type=str, default="blue", help="The name of a colour")
        cli.add_argument("-times", type=int, default=3)
        self.args = cli.parse_args(rospy.myargv()[1:])
        self.node_name = "command_line"
        self.pub = rospy.Publisher("colours", String, queue_size=10)
        rospy.init_node(self.node_name, anonymous=True)
        self.rate = rospy.Rate(10)
        self.ctrl_c = False
        rospy.on_shutdown(self.shutdownhook)
        rospy.loginfo(f"The '{self.node_name}' node is active...")

    def shutdownhook(self):
        self.ctrl_c = True
        print(f"stopping '{self.node_name}' at {self.args.times}")

    def main(self):
        sent = 0
        while not self.ctrl_c and sent < self.args.times:
            self.pub.publish(f"{self.args.colour} {sent}")
            sent += 1
            self.rate.sleep()
        print(f"{sent} times {self.args.colour} on {self.pub.name}, remapped {len(sys.argv) > len(rospy.myargv())}")


if __name__ == "__main__":
    node = Publisher()
    try:
        node.main()
    except rospy.ROSInterruptException:
        pass
