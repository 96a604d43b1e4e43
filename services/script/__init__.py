"""The process of a foreign script: a ROS node's threads, time, names and topics on Elea's runtime."""
