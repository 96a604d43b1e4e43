"""Message types of the bus: records with ROS names, topic names, topics and requests; no I/O, no Zenoh, no physics."""

# Before msgspec, which imports it in C, ignores a Ctrl-C that arrives meanwhile, and crashes at the next message.
import datetime as datetime
