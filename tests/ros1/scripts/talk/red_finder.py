#!/usr/bin/env python
import numpy as np
import rospy
from cv_bridge import CvBridge, CvBridgeError
from sensor_msgs.msg import Image


class RedFinder:
    def __init__(self):
        self.bridge = CvBridge()
        self.widths = []
        self.sub = rospy.Subscriber("camera/image_raw", Image, self.callback)

    def callback(self, data):
        try:
            picture = self.bridge.imgmsg_to_cv2(data, desired_encoding="bgr8")
        except CvBridgeError as e:
            print(e)
            return
        self.widths.append(int(np.count_nonzero(picture[0, :, 2] > 100)))
        if len(self.widths) == 4:
            grown = [(b - a) % 32 for a, b in zip(self.widths, self.widths[1:])]
            print("%dx%d %s, grown by %s" % (data.width, data.height, data.encoding, grown))


if __name__ == "__main__":
    rospy.init_node("red_finder", anonymous=True)
    RedFinder()
    try:
        rospy.spin()
    except KeyboardInterrupt:
        print("bye")
