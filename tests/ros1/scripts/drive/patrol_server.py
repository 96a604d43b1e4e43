#!/usr/bin/env python
from math import atan2, cos, hypot, pi, sin

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseResult
from nav_msgs.msg import Odometry, Path
from tf.transformations import euler_from_quaternion


class Patrol:
    def __init__(self):
        self.pose = None
        self.yaw = 0.0
        self.cmd_vel = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self.path_pub = rospy.Publisher("driven", Path, queue_size=1, latch=True)
        self.path = Path()
        self.path.header.frame_id = "odom"
        rospy.Subscriber("odom", Odometry, self.on_odom)
        self.server = actionlib.SimpleActionServer("move_base", MoveBaseAction, self.execute, auto_start=False)
        self.server.start()

    def on_odom(self, msg):
        self.pose = msg.pose.pose
        o = self.pose.orientation
        self.yaw = euler_from_quaternion([o.x, o.y, o.z, o.w])[2]

    def execute(self, goal):
        target = goal.target_pose.pose.position
        r = rospy.Rate(10)
        while self.pose is None:
            r.sleep()
        while not rospy.is_shutdown():
            if self.server.is_preempt_requested():
                self.server.set_preempted()
                return
            dx, dy = target.x - self.pose.position.x, target.y - self.pose.position.y
            if hypot(dx, dy) < 0.05:
                break
            turn = atan2(dy, dx) - self.yaw
            turn = atan2(sin(turn), cos(turn))
            cmd = Twist()
            cmd.linear.x = 0.2 * max(0.0, cos(turn)) if abs(turn) < pi / 3 else 0.0
            cmd.angular.z = 1.5 * turn
            self.cmd_vel.publish(cmd)
            feedback = MoveBaseFeedback()
            feedback.base_position.header.stamp = rospy.get_rostime()
            feedback.base_position.pose = self.pose
            self.server.publish_feedback(feedback)
            self.path.poses.append(PoseStamped(pose=self.pose))
            r.sleep()
        self.cmd_vel.publish(Twist())
        self.path_pub.publish(self.path)
        self.server.set_succeeded(MoveBaseResult(), "Goal reached")


if __name__ == "__main__":
    rospy.init_node("patrol_server")
    Patrol()
    rospy.spin()
