#!/usr/bin/env python
import math

import numpy as np
import rospy
from geometry_msgs.msg import Pose, Quaternion
from tf import transformations as tft
from tf.transformations import euler_from_quaternion, quaternion_from_euler

rospy.init_node("rotations")
q = quaternion_from_euler(0.1, -0.2, 1.3)
print("euler %s" % [round(v, 6) for v in euler_from_quaternion(q)])
pose = Pose(orientation=Quaternion(*q))
print("w %.6f of a %s" % (pose.orientation.w, type(q).__name__))
m = tft.compose_matrix(angles=(0.1, -0.2, 1.3), translate=(1, 2, 3))
print("matrix %s" % np.round(m[:3, 3], 3).tolist())
inverse = tft.inverse_matrix(m)
print("identity %s" % np.allclose(tft.concatenate_matrices(m, inverse), tft.identity_matrix()))
print("half way %.4f" % euler_from_quaternion(tft.quaternion_slerp([0, 0, 0, 1], quaternion_from_euler(0, 0, 1), 0.5))[2])
turned = tft.quaternion_multiply(quaternion_from_euler(0, 0, 0.5), quaternion_from_euler(0, 0, 0.25))
print("sum %.4f" % euler_from_quaternion(turned)[2])
print("back %.4f" % euler_from_quaternion(tft.quaternion_inverse(turned))[2])
print("rotation %s" % np.round(tft.quaternion_matrix(quaternion_from_euler(0, 0, math.pi / 2))[:2, :2], 6).astype(int).tolist())
print("from matrix %s" % np.allclose(tft.quaternion_from_matrix(m), q))
print("zero %s" % (euler_from_quaternion([0, 0, 0, 0]) == (0, 0, 0),))
print("axis %.4f" % tft.rotation_from_matrix(tft.rotation_matrix(0.3, (0, 0, 1)))[0])
print("euler by matrix %s" % [round(v, 3) for v in tft.euler_from_matrix(tft.euler_matrix(0.2, 0.3, 0.4))])
