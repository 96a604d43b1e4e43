"""Bags: MCAP files as ROS 2 records them (profile ros2, CDR), in a rosbag2 folder; written, read, listed, exported."""
