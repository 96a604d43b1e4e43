"""The commands of ROS 1 under their names, so that a tutorial's lines can be typed as they stand."""
