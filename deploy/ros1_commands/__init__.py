"""The commands of ROS 1 under their names, so that the lines of a tutorial work unchanged."""
