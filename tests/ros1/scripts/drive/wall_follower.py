#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

pub_ = None
regions_ = {"right": 0, "front": 0, "left": 0}
state_ = 0
state_dict_ = {0: "find the wall", 1: "turn left", 2: "follow the wall"}
visited_ = set()
sides_ = []


def clbk_laser(msg):
    global regions_
    regions_ = {
        "right": min(min(msg.ranges[250:290]), 10),
        "front": min(min(msg.ranges[0:25] + msg.ranges[335:360]), 10),
        "left": min(min(msg.ranges[70:110]), 10),
    }
    take_action()


def change_state(state):
    global state_
    if state != state_:
        rospy.loginfo("Wall follower - [%s] - %s" % (state, state_dict_[state]))
        state_ = state
    visited_.add(state)


def take_action():
    d = 0.45
    if regions_["front"] < d:
        change_state(1)
    elif regions_["right"] < d:
        change_state(2)
        sides_.append(regions_["right"])
    else:
        change_state(0)


def find_wall():
    msg = Twist()
    msg.linear.x = 0.15
    msg.angular.z = -0.3
    return msg


def turn_left():
    msg = Twist()
    msg.angular.z = 0.5
    return msg


def follow_the_wall():
    msg = Twist()
    msg.linear.x = 0.2
    msg.angular.z = 0.1 if regions_["right"] < 0.3 else 0.0
    return msg


def main():
    global pub_
    rospy.init_node("wall_follower")
    pub_ = rospy.Publisher("cmd_vel", Twist, queue_size=1)
    rospy.Subscriber("scan", LaserScan, clbk_laser)
    rate = rospy.Rate(20)
    end = rospy.Time.now() + rospy.Duration(14)
    while not rospy.is_shutdown() and rospy.Time.now() < end:
        msg = Twist()
        if regions_["front"] == 0:
            rate.sleep()
            continue
        if state_ == 0:
            msg = find_wall()
        elif state_ == 1:
            msg = turn_left()
        elif state_ == 2:
            msg = follow_the_wall()
        else:
            rospy.logerr("Unknown state!")
        pub_.publish(msg)
        rate.sleep()
    pub_.publish(Twist())
    print("states %s, beside the wall %s" % (sorted(visited_), len(sides_) > 5 and min(sides_) > 0.1))


if __name__ == "__main__":
    main()
