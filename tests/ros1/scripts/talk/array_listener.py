#!/usr/bin/env python
import numpy
import rospy
from rospy.numpy_msg import numpy_msg
from rospy_tutorials.msg import Floats
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

rospy.init_node("array_listener")
pub = rospy.Publisher("floats", numpy_msg(Floats), queue_size=1, latch=True)
pub.publish(numpy.array([1.0, 2.1, 3.2, 4.3], dtype=numpy.float32))
msg = rospy.wait_for_message("floats", numpy_msg(Floats), 300)
print("%s of %s, mean %.3f" % (type(msg.data).__name__, msg.data.dtype, msg.data.mean()))
plain = rospy.wait_for_message("floats", Floats, 300)
print(type(plain.data).__name__, len(plain.data))
grid = Float64MultiArray()
grid.layout.dim.append(MultiArrayDimension("rows", 2, 4))
grid.data = [0.5] * 4
grids = rospy.Publisher("grid", Float64MultiArray, queue_size=1, latch=True)
grids.publish(grid)
back = rospy.wait_for_message("grid", Float64MultiArray, 300)
print(back.layout.dim[0].label, sum(back.data))
