#!/usr/bin/env python
import rospy
from rospy_tutorials.msg import HeaderString

seqs, stamps = [], []


def got(msg):
    seqs.append(msg.header.seq)
    stamps.append(msg.header.stamp)
    if len(seqs) == 6:
        gaps = [(b - a).to_sec() for a, b in zip(stamps, stamps[1:])]
        print("seq rises by %s" % [b - a for a, b in zip(seqs, seqs[1:])])
        print("mean gap %.1f s in %s" % (sum(gaps) / len(gaps), msg.header.frame_id))


rospy.init_node("header_listener")
rospy.Subscriber("headered", HeaderString, got, queue_size=10)
rospy.spin()
