#!/usr/bin/env python
import rospy

rospy.set_param("/house/rooms", {"kitchen": {"lamps": 2}, "hall": {"lamps": 5}})
rospy.set_param("/house/heights", (2.5, 3.0))
rospy.init_node("parameter_writer")
rospy.set_param("~speed", 0.25)
rospy.set_param("gain", 7)
rospy.set_param("/house/ready", True)
rospy.spin()
