"""Message types of the bus: records with ROS names, topic names, topics and requests; no I/O, no Zenoh, no physics."""

# Loaded before msgspec, whose C code ignores a Ctrl-C that arrives while it loads datetime itself, and crashes later.
import datetime as datetime
