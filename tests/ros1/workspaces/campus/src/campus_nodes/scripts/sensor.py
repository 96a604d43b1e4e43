#!/usr/bin/env python
import rospy
from campus_interfaces.msg import Reading
from campus_nodes.rooms import reading_of


def main():
    rospy.init_node("sensor")
    pub = rospy.Publisher("readings", Reading, queue_size=10)
    rate = rospy.Rate(rospy.get_param("~rate", 5))
    index = 0
    while not rospy.is_shutdown():
        pub.publish(reading_of(index, rospy.Time.now()))
        index += 1
        rate.sleep()


if __name__ == "__main__":
    try:
        main()
    except rospy.ROSInterruptException:
        pass
