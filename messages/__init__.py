"""The vocabulary: ROS-named records, names, topics and requests; no input or output, no Zenoh, no physics."""
