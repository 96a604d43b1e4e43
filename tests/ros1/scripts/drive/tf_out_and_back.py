#!/usr/bin/env python
import sys
from math import atan2, copysign, pi, pow, sqrt

import rospy
import tf
from geometry_msgs.msg import Point, Quaternion, Twist


def quat_to_angle(q):
    return atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def normalize(angle):
    res = angle
    while res > pi:
        res -= 2.0 * pi
    while res < -pi:
        res += 2.0 * pi
    return res


class OutAndBack:
    def __init__(self):
        rospy.init_node("tf_out_and_back", anonymous=False)
        rospy.on_shutdown(self.shutdown)
        self.cmd_vel = rospy.Publisher("/cmd_vel", Twist, queue_size=5)
        r = rospy.Rate(20)
        self.tf_listener = tf.TransformListener()
        rospy.sleep(0.5)
        self.odom_frame = "/odom"
        try:
            self.tf_listener.waitForTransform(self.odom_frame, "/base_nowhere", rospy.Time(), rospy.Duration(0.5))
            self.base_frame = "/base_nowhere"
        except (tf.Exception, tf.ConnectivityException, tf.LookupException):
            try:
                self.tf_listener.waitForTransform(self.odom_frame, "/base_footprint", rospy.Time(), rospy.Duration(60.0))
                self.base_frame = "/base_footprint"
            except (tf.Exception, tf.ConnectivityException, tf.LookupException):
                rospy.signal_shutdown("tf Exception")
        (home, rotation) = self.get_odom()
        position = Point()
        for i in range(2):
            move_cmd = Twist()
            move_cmd.linear.x = 0.2
            (position, rotation) = self.get_odom()
            x_start, y_start = position.x, position.y
            distance = 0
            while distance < 0.3 and not rospy.is_shutdown():
                self.cmd_vel.publish(move_cmd)
                r.sleep()
                (position, rotation) = self.get_odom()
                distance = sqrt(pow((position.x - x_start), 2) + pow((position.y - y_start), 2))
            self.cmd_vel.publish(Twist())
            rospy.sleep(0.5)
            move_cmd = Twist()
            move_cmd.angular.z = 1.2
            last_angle = rotation
            turn_angle = 0
            while abs(turn_angle + 0.04) < pi and not rospy.is_shutdown():
                self.cmd_vel.publish(move_cmd)
                r.sleep()
                (position, rotation) = self.get_odom()
                delta_angle = normalize(rotation - last_angle)
                turn_angle += delta_angle
                last_angle = rotation
            self.cmd_vel.publish(Twist())
            rospy.sleep(0.5)
        self.cmd_vel.publish(Twist())
        print("home %s facing %s" % (sqrt((position.x - home.x) ** 2 + (position.y - home.y) ** 2) < 0.15, copysign(1, 0.3 - abs(rotation)) > 0))

    def get_odom(self):
        try:
            (trans, rot) = self.tf_listener.lookupTransform(self.odom_frame, self.base_frame, rospy.Time(0))
        except (tf.Exception, tf.ConnectivityException, tf.LookupException):
            rospy.loginfo("TF Exception")
            return
        return (Point(*trans), quat_to_angle(Quaternion(*rot)))

    def shutdown(self):
        self.cmd_vel.publish(Twist())
        rospy.sleep(1)


if __name__ == "__main__":
    try:
        OutAndBack()
    except rospy.ROSInterruptException:
        sys.exit(1)
