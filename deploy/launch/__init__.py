"""ROS 1 launch files: read as roslaunch reads them, and converted to fleets."""
