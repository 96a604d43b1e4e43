#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from math import radians


class DrawASquare:
    def __init__(self):
        rospy.init_node("timed_square", anonymous=False)
        rospy.on_shutdown(self.shutdown)
        self.cmd_vel = rospy.Publisher("cmd_vel", Twist, queue_size=10)
        r = rospy.Rate(5)
        move_cmd = Twist()
        move_cmd.linear.x = 0.2
        turn_cmd = Twist()
        turn_cmd.linear.x = 0
        turn_cmd.angular.z = radians(75)
        for count in range(4):
            if rospy.is_shutdown():
                break
            for x in range(0, 6):
                self.cmd_vel.publish(move_cmd)
                r.sleep()
            for x in range(0, 6):
                self.cmd_vel.publish(turn_cmd)
                r.sleep()
        print("square done")

    def shutdown(self):
        rospy.loginfo("Stop Drawing Squares")
        self.cmd_vel.publish(Twist())
        rospy.sleep(1)


if __name__ == "__main__":
    try:
        DrawASquare()
    except rospy.ROSInterruptException:
        rospy.loginfo("node terminated.")
