#!/usr/bin/env python
import rospy
from std_msgs.msg import Int32

good = []


def callback(msg):
    if msg.data % 2:
        raise RuntimeError("odd %d" % msg.data)
    good.append(msg.data)


rospy.init_node("bad_callback")
rospy.Subscriber("own_numbers", Int32, callback)
pub = rospy.Publisher("own_numbers", Int32, queue_size=10)
while pub.get_num_connections() == 0:
    rospy.sleep(0.05)
for i in range(6):
    pub.publish(i)
    rospy.sleep(0.05)
while len(good) < 3:
    rospy.sleep(0.05)
print("good %s" % good)
try:
    pub.publish("five")
except rospy.ROSException as error:
    print("refused: %s" % error)
