"""Records as CDR, the serialisation of ROS 2, and their types as ROS 2 writes them (``ros2msg``).

How what ROS has no word for is written:

========================================  ==========================================================================
in a record                               in CDR
========================================  ==========================================================================
a standard type                           ROS 2's own definition; what it has beyond ours is zero
``float``                                 ``float64``; ``float32`` where ROS 2 says so (the value is rounded)
``int``                                   the narrowest of uint8, uint32, int32, int64 that holds its bounds
a literal                                 ``string``
``X | None``                              ``X[<=1]``, empty for None
``messages.parameters.Value``             ``string`` that holds it as JSON
``rosgraph_msgs/Clock``                   ROS 2's Clock, and tick, epoch and pause in a message beside it
``rosgraph_msgs/Log``                     ``rcl_interfaces/Log`` of ROS 2 with its levels, and what it lacks beside it
========================================  ==========================================================================
"""
