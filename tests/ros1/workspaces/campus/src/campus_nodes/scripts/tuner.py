#!/usr/bin/env python
import dynamic_reconfigure.client
import rospy

seen = []


def callback(config):
    seen.append(config["kp"])


if __name__ == "__main__":
    rospy.init_node("tuner")
    client = dynamic_reconfigure.client.Client("tuned", timeout=30, config_callback=callback)
    before = client.get_configuration(timeout=5)
    print("before kp %.2f ki %.2f" % (before["kp"], before["ki"]))
    after = client.update_configuration({"kp": 3.5, "mode": 1})
    print("after kp %.2f mode %d" % (after["kp"], after["mode"]))
    clamped = client.update_configuration({"kp": 99.0})
    print("clamped kp %.2f" % clamped["kp"])
    twice = client.update_configuration({"label": "twice", "repeats": 4})
    print("repeats %d enabled %s" % (twice["repeats"], twice["enabled"]))
    rospy.sleep(0.5)
    print("seen %.2f to %.2f" % (seen[0], seen[-1]))
    print("parameter %.2f" % rospy.get_param("/tuned/kp" if rospy.get_namespace() == "/" else "tuned/kp"))
