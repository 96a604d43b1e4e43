"""Launch files of ROS 1: read as roslaunch reads them, and made into fleets."""
