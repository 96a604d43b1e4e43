#!/usr/bin/env python
import rospy
from arm_parameters.cfg import ArmConfig
from dynamic_reconfigure.server import Server

if __name__ == "__main__":
    rospy.init_node("arm_parameters", anonymous=False)
    server = Server(ArmConfig, lambda config, level: config)
    rospy.spin()
