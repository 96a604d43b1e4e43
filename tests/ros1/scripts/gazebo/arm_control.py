#!/usr/bin/env python
import math
import time

import dynamic_reconfigure.client
import gazebo_ros
import rospy
import tf
from gazebo_msgs.msg import LinkStates
from gazebo_msgs.srv import ApplyJointEffort, GetJointProperties, JointRequest
from std_msgs.msg import Float32


class ArmControl():
    def __init__(self, joint_name="bear_link"):
        self.joint_name = joint_name
        rospy.Subscriber("/robot_control/reference", Float32, self.reference)
        self.control_pub = rospy.Publisher("/robot_control/control_signal", Float32, queue_size=100)
        self.angle_pub = rospy.Publisher("/robot_control/joint_angle", Float32, queue_size=100)
        for name in ("apply_joint_effort", "clear_joint_forces", "get_joint_properties"):
            rospy.wait_for_service("/gazebo/" + name)
        self.effort = rospy.ServiceProxy("/gazebo/apply_joint_effort", ApplyJointEffort)
        self.clear = rospy.ServiceProxy("/gazebo/clear_joint_forces", JointRequest)
        self.properties = rospy.ServiceProxy("/gazebo/get_joint_properties", GetJointProperties)
        client = dynamic_reconfigure.client.Client("/arm_parameters", timeout=300, config_callback=self.changed)
        self.ref_angle = 0
        self.Kp, self.Ki, self.Kd = 8.0, 1.2, 1.0
        self.last_time = time.time()
        self.integral = self.last_error = 0.0

    def reference(self, msg):
        self.ref_angle = float(msg.data)

    def changed(self, config):
        self.Kp, self.Kd = float("{Kp}".format(**config)), float("{Kd}".format(**config))

    def signal(self, angle):
        error = self.ref_angle - angle
        now = time.time()
        delta = now - self.last_time
        self.integral = max(-20, min(20, self.integral + error * delta))
        slope = (error - self.last_error) / delta if delta > 0 else 0.0
        self.last_time, self.last_error = now, error
        return max(-200, min(200, self.Kp * error + self.Ki * self.integral + self.Kd * slope))

    def step(self):
        angle = math.degrees(self.properties(self.joint_name).position[0])
        self.angle_pub.publish(angle)
        effort = self.signal(angle)
        self.control_pub.publish(effort)
        self.effort(self.joint_name, effort, rospy.Duration.from_sec(0), rospy.Duration.from_sec(0.1))


if __name__ == "__main__":
    rospy.init_node("arm_control")
    control = ArmControl()
    while not rospy.is_shutdown():
        control.step()
