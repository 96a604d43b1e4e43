#!/usr/bin/env python
import dynamic_reconfigure.client
import rospy
from gazebo_msgs.srv import GetJointProperties
from math import degrees

rospy.init_node("arm_exercise")
client = dynamic_reconfigure.client.Client("/arm_parameters", timeout=300)
joint = rospy.ServiceProxy("/gazebo/get_joint_properties", GetJointProperties)
rospy.sleep(1)
client.update_configuration({"ref_angle": 30.0, "Kp": 37.5, "Kd": 2.8})
rospy.sleep(3)
angle = degrees(joint("bear_link").position[0])
print("step reached %.0f" % angle)
client.update_configuration({"reference_type": 1, "sin_ref_gain": 20.0, "sin_ref_f": 0.5})
rospy.sleep(1)
lows, highs = [], []
for period in range(2):
    seen = []
    end = rospy.get_time() + 2
    while rospy.get_time() < end:
        seen.append(degrees(joint("bear_link").position[0]))
        rospy.sleep(0.05)
    lows.append(min(seen))
    highs.append(max(seen))
print("swings from %.0f to %.0f" % (round(min(lows), -1), round(max(highs), -1)))
