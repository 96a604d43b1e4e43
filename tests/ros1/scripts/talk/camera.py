#!/usr/bin/env python
import numpy as np
import rospy
from cv_bridge import CvBridge
from sensor_msgs.msg import Image

rospy.init_node("camera")
bridge = CvBridge()
pub = rospy.Publisher("camera/image_raw", Image, queue_size=1)
rate = rospy.Rate(5)
n = 0
while not rospy.is_shutdown():
    picture = np.zeros((24, 32, 3), np.uint8)
    picture[:, : n % 32] = (10, 20, 200)
    msg = bridge.cv2_to_imgmsg(picture, "bgr8")
    msg.header.frame_id = "lens"
    pub.publish(msg)
    n += 1
    rate.sleep()
