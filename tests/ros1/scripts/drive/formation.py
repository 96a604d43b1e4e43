# -*- coding: utf-8 -*-
import rospy
import math
import nav_msgs.msg
import geometry_msgs.msg
from tf.transformations import euler_from_quaternion

# Punkte der Fahrt
x = 0
y = 0
q = [0, 0, 0, 0]
X_goal = [0.5, 0.5, 0]
Y_goal = [0, 0.4, 0]
r = 0


def pose(msg):
    global x, y, q
    x = msg.pose.pose.position.x
    y = msg.pose.pose.position.y
    o = msg.pose.pose.orientation
    q = [o.x, o.y, o.z, o.w]
    return x, y


if __name__ == '__main__':
    rospy.init_node('formation')
    vel = rospy.Publisher('/tb3_0/cmd_vel', geometry_msgs.msg.Twist, queue_size=1)
    rate = rospy.Rate(10.0)
    while not rospy.is_shutdown() and r < 3:
        msg = geometry_msgs.msg.Twist()
        (roll, pitch, yaw) = euler_from_quaternion(q)
        D = math.sqrt(math.pow(X_goal[r] - x, 2) + math.pow(Y_goal[r] - y, 2))
        turn = math.atan2(Y_goal[r] - y, X_goal[r] - x) - yaw
        if turn < -math.pi:
            turn = turn + 2 * math.pi
        if turn > math.pi:
            turn = turn - 2 * math.pi
        if D < 0.15:
            r = r + 1
            print r
        msg.linear.x = 0.2 if abs(turn) < 0.5 else 0.05
        msg.angular.z = 1.2 * turn
        vel.publish(msg)
        rospy.Subscriber('/tb3_0/odom', nav_msgs.msg.Odometry, pose)
        rate.sleep()
    vel.publish(geometry_msgs.msg.Twist())
    rospy.sleep(0.5)
