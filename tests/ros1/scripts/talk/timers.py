#!/usr/bin/env python
import rospy
from std_msgs.msg import Float32


class Clockwork(object):
    def __init__(self):
        self.ticks = 0
        self.fired = []
        self.pub = rospy.Publisher("~ticks", Float32, queue_size=1)
        self.timer = rospy.Timer(rospy.Duration(0.2), self.tick)
        rospy.Timer(rospy.Duration(0.5), self.once, oneshot=True)

    def tick(self, event):
        self.ticks += 1
        if event.last_real is not None:
            period = (event.current_expected - event.last_expected).to_sec()
            assert abs(period - 0.2) < 1e-6, period
        self.pub.publish(self.ticks)
        if self.ticks == 5:
            self.timer.shutdown()

    def once(self, event):
        self.fired.append(event.last_real)


if __name__ == "__main__":
    rospy.init_node("timers")
    works = Clockwork()
    while works.ticks < 5 or not works.fired:
        rospy.sleep(0.1)
    print("once, with last_real %s" % works.fired[0])
    rospy.sleep(1.5)
    print("ticks at the end: %d" % works.ticks)
