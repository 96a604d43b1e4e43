#!/usr/bin/env python
import rospy
from campus_nodes.cfg import TuningConfig
from dynamic_reconfigure.server import Server


def callback(config, level):
    print("kp {kp:.2f} ki {ki:.2f} x{repeats} {label} mode {mode}".format(**config) + " level %d" % (level & 15))
    if config.label == "twice":
        config.repeats = min(2 * config.repeats, 20)
    return config


if __name__ == "__main__":
    rospy.init_node("tuned")
    server = Server(TuningConfig, callback)
    rospy.spin()
