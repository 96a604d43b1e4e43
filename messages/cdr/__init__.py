"""CDR, the serialisation of ROS 2, for records, and their type definitions as ROS 2 writes them (``ros2msg``).

Values without a ROS 2 type are written as follows:

========================================  ==========================================================================
in a record                               in CDR
========================================  ==========================================================================
a standard type                           ROS 2's own definition; fields that the record lacks are zero
``float``                                 ``float64``; ``float32`` where ROS 2 says so (the value is rounded)
``int``                                   the narrowest of uint8, uint32, int32, int64 that holds its bounds
a literal                                 ``string``
``X | None``                              ``X[<=1]``, empty for None
``messages.parameters.Value``             ``string`` that holds JSON
``rosgraph_msgs/Clock``                   ROS 2's Clock; tick, epoch and pause in a sidecar message
``rosgraph_msgs/Log``                     ROS 2's ``rcl_interfaces/Log`` and levels; what it lacks in a sidecar message
========================================  ==========================================================================
"""
