#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse


class Mover(object):
    def __init__(self):
        self.pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self.curl = False
        rospy.Service("~curl", SetBool, self.on_curl)
        rospy.Service("move_in_circle", Trigger, self.on_move)
        rospy.loginfo("Service ready")

    def on_curl(self, req):
        self.curl = req.data
        return SetBoolResponse(success=True, message="Done!")

    def on_move(self, req):
        cmd = Twist()
        cmd.linear.x = 0.15
        cmd.angular.z = 0.6 if self.curl else 0.0
        i = 0
        while i < 40:
            self.pub.publish(cmd)
            rospy.sleep(0.1)
            i += 1
        self.pub.publish(Twist())
        return TriggerResponse(True, "moved %d steps" % i)


rospy.init_node("move_service")
Mover()
rospy.spin()
