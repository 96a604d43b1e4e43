"""Message types of the bus: records with ROS names, topic names, topics and requests; no I/O, no Zenoh, no physics."""
