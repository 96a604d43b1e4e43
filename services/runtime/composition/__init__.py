"""Composition: several nodes in one process, ROS 2's component container, on one connection and in one thread."""
