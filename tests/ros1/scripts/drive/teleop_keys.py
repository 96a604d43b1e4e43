#!/usr/bin/env python
from __future__ import print_function

import select
import sys
import termios
import threading
import tty

import rospy
from geometry_msgs.msg import Twist

HELP = """
w/x: forward and back, a/d: turn, space: stop, q: quit
"""
BINDINGS = {"w": (1, 0), "x": (-1, 0), "a": (0, 1), "d": (0, -1), " ": (0, 0)}


class PublishThread(threading.Thread):
    def __init__(self, rate):
        super(PublishThread, self).__init__()
        self.publisher = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self.x = self.th = 0.0
        self.condition = threading.Condition()
        self.done = False
        self.timeout = 1.0 / rate
        self.start()

    def wait_for_subscribers(self):
        i = 0
        while not rospy.is_shutdown() and self.publisher.get_num_connections() == 0:
            if i == 4:
                print("Waiting for subscriber to connect to {}".format(self.publisher.name))
            rospy.sleep(0.5)
            i = (i + 1) % 5
        if rospy.is_shutdown():
            raise Exception("Got shutdown request before subscribers connected")

    def update(self, x, th):
        with self.condition:
            self.x, self.th = x, th
            self.condition.notify()

    def stop(self):
        self.done = True
        self.update(0, 0)
        self.join()

    def run(self):
        while not self.done:
            self.condition.acquire()
            self.condition.wait(self.timeout)
            twist = Twist()
            twist.linear.x, twist.angular.z = self.x, self.th
            self.condition.release()
            self.publisher.publish(twist)
        self.publisher.publish(Twist())


def get_key(settings, timeout):
    tty.setraw(sys.stdin.fileno())
    rlist, _, _ = select.select([sys.stdin], [], [], timeout)
    key = sys.stdin.read(1) if rlist else ""
    termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)
    return key


if __name__ == "__main__":
    settings = termios.tcgetattr(sys.stdin)
    rospy.init_node("teleop_keys")
    speed = rospy.get_param("~speed", 0.2)
    turn = rospy.get_param("~turn", 1.0)
    thread = PublishThread(10.0)
    try:
        thread.wait_for_subscribers()
        print(HELP)
        while not rospy.is_shutdown():
            key = get_key(settings, 0.2)
            if key == "q" or key == "\x03":
                break
            if key in BINDINGS:
                x, th = BINDINGS[key]
                thread.update(speed * x, turn * th)
                print("currently: speed %.2f turn %.2f" % (speed * x, turn * th))
    except Exception as e:
        print(e)
    finally:
        thread.stop()
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)
