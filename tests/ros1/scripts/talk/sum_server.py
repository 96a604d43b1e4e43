#!/usr/bin/env python
from rospy_tutorials.srv import *
import rospy


def add(req):
    print("Returning [%s + %s = %s]" % (req.a, req.b, req.a + req.b))
    return AddTwoIntsResponse(req.a + req.b)


def server():
    rospy.init_node("sum_server")
    rospy.Service("add_two_ints", AddTwoInts, add)
    print("Ready to add.")
    rospy.spin()


if __name__ == "__main__":
    server()
