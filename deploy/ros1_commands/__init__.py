"""The commands of ROS 1 under their own names, so that the commands of a tutorial work unchanged."""
