"""Bags: MCAP files as recorded by ROS 2 (profile ros2, CDR) in a rosbag2 folder; writing, reading, listing, export."""
