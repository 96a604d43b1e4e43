"""A bag that is none of ours."""

from __future__ import annotations

from pathlib import Path

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from tests.bag.make import START

STORE = get_typestore(Stores.ROS2_JAZZY)


def of_rosbag2(folder: Path) -> Path:
    """A bag as ROS 2 would have written it, by rosbags."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        twist = writer.add_connection("/cmd_vel", "geometry_msgs/msg/Twist", typestore=STORE)
        log = writer.add_connection("/rosout", "rcl_interfaces/msg/Log", typestore=STORE)
        battery = writer.add_connection("/battery", "sensor_msgs/msg/BatteryState", typestore=STORE)
        types = STORE.types
        vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
        move = types["geometry_msgs/msg/Twist"](linear=vector(x=0.5, y=0, z=0), angular=vector(x=0, y=0, z=-1))
        line = types["rcl_interfaces/msg/Log"](
            stamp=time(sec=3, nanosec=4), level=30, name="n", msg="careful", file="f", function="g", line=7
        )
        for number in range(3):
            writer.write(twist, START + number * 10**8, STORE.serialize_cdr(move, "geometry_msgs/msg/Twist"))
        writer.write(log, START + 5, STORE.serialize_cdr(line, "rcl_interfaces/msg/Log"))
        writer.write(battery, START + 6, b"\0\1\0\0" + bytes(100))
    return folder
