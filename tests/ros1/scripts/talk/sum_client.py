#!/usr/bin/env python
from __future__ import print_function
import sys

import rospy
from rospy_tutorials.srv import AddTwoInts, AddTwoIntsRequest


def ask(x, y):
    rospy.wait_for_service("add_two_ints")
    try:
        add = rospy.ServiceProxy("add_two_ints", AddTwoInts)
        r1 = add(x, y)
        r2 = add(a=x, b=y)
        r3 = add.call(AddTwoIntsRequest(x, y))
        return r1.sum, r2.sum, r3.sum
    except rospy.ServiceException as e:
        print("call failed: %s" % e)


def usage():
    return "%s x y" % sys.argv[0]


if __name__ == "__main__":
    argv = rospy.myargv(sys.argv)
    if len(argv) != 3:
        print(usage())
        sys.exit(1)
    x, y = int(argv[1]), int(argv[2])
    print("%s + %s = %s" % (x, y, ask(x, y)))
