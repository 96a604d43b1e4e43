#!/usr/bin/env python
import rospy
from std_msgs.msg import Bool, Int32, String


class Mixer:
    def __init__(self):
        rospy.init_node("two_inputs")
        self.text = None
        self.number = None
        self.sent = 0
        rospy.Subscriber("chatter", String, self.on_text)
        rospy.Subscriber("number", Int32, self.on_number)
        self.pub = rospy.Publisher("mixed", String, queue_size=1)
        self.flag = rospy.Publisher("mixed/ready", Bool, queue_size=1, latch=True)

    def on_text(self, msg):
        self.text = msg.data

    def on_number(self, msg):
        self.number = msg.data

    def run(self):
        r = rospy.Rate(20)
        while not rospy.is_shutdown() and self.sent < 20:
            if self.text is not None and self.number is not None:
                self.pub.publish("%s/%d" % (self.text, self.number))
                self.sent += 1
            r.sleep()
        self.flag.publish(True)
        print("mixed %d" % self.sent)


if __name__ == "__main__":
    try:
        Mixer().run()
    except rospy.ROSInterruptException:
        pass
