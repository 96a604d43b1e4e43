#!/usr/bin/env python
import os
import tempfile

import rosbag
import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Int32, String

rospy.init_node("bag_round")
path = os.path.join(tempfile.mkdtemp(), "round.bag")
bag = rosbag.Bag(path, "w")
try:
    for i in range(10):
        bag.write("counts", Int32(data=i), rospy.Time(100 + i))
    bag.write("words", String("hello"), rospy.Time(105.5))
    cmd = Twist()
    cmd.linear.x = 0.25
    bag.write("cmd_vel", cmd, rospy.Time(107.25))
finally:
    bag.close()

total = 0
with rosbag.Bag(path) as bag:
    for topic, msg, t in bag.read_messages(topics=["counts"]):
        total += msg.data
    print("sum %d" % total)
    for topic, msg, t in bag.read_messages(topics=["words", "cmd_vel"]):
        print(topic, t.to_sec(), msg.data if topic == "words" else msg.linear.x)
    window = bag.read_messages(topics=["counts"], start_time=rospy.Time(102), end_time=rospy.Time(104))
    print("window %s" % [m.data for _, m, _ in window])
    print("%d messages, types %s" % (bag.get_message_count(), sorted(bag.get_type_and_topic_info()[0])))
