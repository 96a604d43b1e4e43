"""Commands of ROS 1 as programs on our rospy: `./elea env ros1` gives them their names."""
