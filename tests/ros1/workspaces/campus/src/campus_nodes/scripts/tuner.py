#!/usr/bin/env python
import dynamic_reconfigure.client
import rospy

seen = []


def callback(config):
    seen.append(config["kp"])


if __name__ == "__main__":
    rospy.init_node("tuner")
    client = dynamic_reconfigure.client.Client("tuned", timeout=300, config_callback=callback)
    before = client.get_configuration(timeout=60)
    print("before kp %.2f ki %.2f" % (before["kp"], before["ki"]))
    after = client.update_configuration({"kp": 3.5, "mode": 1})
    print("after kp %.2f mode %d" % (after["kp"], after["mode"]))
    clamped = client.update_configuration({"kp": 99.0})
    print("clamped kp %.2f" % clamped["kp"])
    twice = client.update_configuration({"label": "twice", "repeats": 4})
    print("repeats %d enabled %s" % (twice["repeats"], twice["enabled"]))
    while seen[-1:] != [10.0]:
        rospy.sleep(0.05)
    print("seen %.2f to %.2f" % (seen[0], seen[-1]))
    parameter = "/tuned/kp" if rospy.get_namespace() == "/" else "tuned/kp"
    while rospy.get_param(parameter) != 10.0:
        rospy.sleep(0.05)
    print("parameter %.2f" % rospy.get_param(parameter))
