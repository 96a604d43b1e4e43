#!/usr/bin/env python
import time

import dynamic_reconfigure.client
import numpy as np
import rospy
from std_msgs.msg import Float32


class ReferenceSignal():
    def __init__(self):
        self.pub = rospy.Publisher("/robot_control/reference", Float32, queue_size=100)
        dynamic_reconfigure.client.Client("/arm_parameters", timeout=300, config_callback=self.changed)
        self.kind, self.angle, self.gain, self.f = "step", 0.0, 1.0, 1.0
        self.start = time.time()

    def changed(self, config):
        self.kind = "step" if "{reference_type}".format(**config) == "0" else "sine"
        self.angle = float("{ref_angle}".format(**config))
        self.gain = float("{sin_ref_gain}".format(**config))
        self.f = float("{sin_ref_f}".format(**config))

    def publish(self):
        if self.kind == "step":
            self.pub.publish(self.angle)
        else:
            self.pub.publish(np.sin(2 * np.pi * self.f * (time.time() - self.start)) * self.gain)


if __name__ == "__main__":
    rospy.init_node("arm_reference")
    publisher = ReferenceSignal()
    rate = rospy.Rate(50)
    while not rospy.is_shutdown():
        publisher.publish()
        rate.sleep()
