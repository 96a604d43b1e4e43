#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from std_srvs.srv import Empty
from turtlesim.msg import Color, Pose
from turtlesim.srv import Kill, SetPen, Spawn, TeleportAbsolute, TeleportRelative

poses = []


def width():
    return max(p.x for p in poses) - min(p.x for p in poses) if poses else 0.0


def wait_at(x):
    while abs(poses[-1].x - x) > 0.05:
        rospy.sleep(0.05)


rospy.init_node("spiral")
rospy.wait_for_service("spawn")
spawner = rospy.ServiceProxy("spawn", Spawn)
print(spawner(3.0, 8.0, 0.0, "cleaner").name)
rospy.Subscriber("cleaner/pose", Pose, poses.append)
rospy.ServiceProxy("cleaner/set_pen", SetPen)(255, 0, 0, 5, 0)
pub = rospy.Publisher("cleaner/cmd_vel", Twist, queue_size=10)
while pub.get_num_connections() == 0:
    rospy.sleep(0.05)
cmd = Twist()
cmd.angular.z = 4.0
r = rospy.Rate(10)
while cmd.linear.x < 2.0:
    cmd.linear.x += 0.1
    pub.publish(cmd)
    r.sleep()
pub.publish(Twist())
while width() <= 0.3 or poses[-1].linear_velocity:
    rospy.sleep(0.05)
print("wide %s" % (width() > 0.3))
rospy.ServiceProxy("cleaner/teleport_absolute", TeleportAbsolute)(1.0, 2.0, 0.5)
wait_at(1.0)
print("at %.1f %.1f %.1f" % (poses[-1].x, poses[-1].y, poses[-1].theta))
rospy.ServiceProxy("cleaner/teleport_relative", TeleportRelative)(1.0, -0.5)
wait_at(2.0)
print("then %.1f %.1f %.1f" % (poses[-1].x, poses[-1].y, poses[-1].theta))
colour = rospy.wait_for_message("cleaner/color_sensor", Color, 60)
print("colour %d" % colour.b)
try:
    spawner(1, 1, 0, "cleaner")
except rospy.ServiceException:
    print("no second one")
rospy.ServiceProxy("kill", Kill)("cleaner")
rospy.ServiceProxy("clear", Empty)()
print("red %s" % rospy.get_param("/turtlesim/background_r"))
