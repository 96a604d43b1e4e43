#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from turtlesim.msg import Pose

PI = 3.1415926535897
pose = None


def update(msg):
    global pose
    pose = msg


def move(velocity_publisher, speed, distance, is_forward):
    velocity_message = Twist()
    velocity_message.linear.x = abs(speed) if is_forward else -abs(speed)
    x0, y0 = pose.x, pose.y
    loop_rate = rospy.Rate(50)
    moved = 0.0
    while moved < distance:
        velocity_publisher.publish(velocity_message)
        loop_rate.sleep()
        moved = ((pose.x - x0) ** 2 + (pose.y - y0) ** 2) ** 0.5
    velocity_message.linear.x = 0
    velocity_publisher.publish(velocity_message)


def rotate(velocity_publisher, degrees_per_s, degrees, clockwise):
    vel_msg = Twist()
    angular_speed = degrees_per_s * 2 * PI / 360
    vel_msg.angular.z = -abs(angular_speed) if clockwise else abs(angular_speed)
    t0 = rospy.Time.now().to_sec()
    current_angle = 0
    while current_angle < degrees * 2 * PI / 360:
        velocity_publisher.publish(vel_msg)
        t1 = rospy.Time.now().to_sec()
        current_angle = angular_speed * (t1 - t0)
        rospy.sleep(0.01)
    vel_msg.angular.z = 0
    velocity_publisher.publish(vel_msg)


if __name__ == "__main__":
    try:
        rospy.init_node("mover", anonymous=True)
        velocity_publisher = rospy.Publisher("/turtle1/cmd_vel", Twist, queue_size=10)
        rospy.Subscriber("/turtle1/pose", Pose, update)
        while pose is None:
            rospy.sleep(0.1)
        print("from %.2f %.2f" % (pose.x, pose.y))
        move(velocity_publisher, 1.0, 2.0, True)
        rospy.sleep(0.2)
        rotate(velocity_publisher, 45, 90, False)
        rospy.sleep(0.2)
        print("moved %.1f, turned %.1f" % (pose.x - 5.544, pose.theta))
        print("slots %s" % Pose.__slots__)
    except rospy.ROSInterruptException:
        rospy.loginfo("node terminated.")
