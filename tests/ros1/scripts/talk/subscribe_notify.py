#!/usr/bin/env python
import rospy
from std_msgs.msg import String


class Greeter(rospy.SubscribeListener):
    def peer_subscribe(self, topic_name, topic_publish, peer_publish):
        print("a peer subscribed to %s" % topic_name)
        peer_publish(String("welcome"))

    def peer_unsubscribe(self, topic_name, num_peers):
        print("a peer left, %d remain" % num_peers)


def main():
    rospy.init_node("subscribe_notify")
    rospy.Publisher("greetings", String, subscriber_listener=Greeter(), queue_size=1)
    rospy.spin()


main()
