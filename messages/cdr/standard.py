"""ROS 2's own definitions of the standard types that are recorded: field order and widths, as in Jazzy.

Facts of rcl_interfaces, common_interfaces and geometry2 (Apache-2.0 and BSD-3-Clause). A test compares the hash of each
with that of an independent library.
"""

STANDARD: dict[str, str] = {
    "builtin_interfaces/Duration": "int32 sec; uint32 nanosec",
    "builtin_interfaces/Time": "int32 sec; uint32 nanosec",
    "diagnostic_msgs/DiagnosticArray": "std_msgs/Header header; diagnostic_msgs/DiagnosticStatus[] status",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte level; string name; string message; string hardware_id; diagnostic_msgs/KeyValue[] values"
    ),
    "diagnostic_msgs/KeyValue": "string key; string value",
    "geometry_msgs/Point": "float64 x; float64 y; float64 z",
    "geometry_msgs/Point32": "float32 x; float32 y; float32 z",
    "geometry_msgs/Pose": "geometry_msgs/Point position; geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseStamped": "std_msgs/Header header; geometry_msgs/Pose pose",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose; float64[36] covariance",
    "geometry_msgs/Quaternion": "float64 x; float64 y; float64 z; float64 w",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation; geometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header; string child_frame_id; geometry_msgs/Transform transform"
    ),
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear; geometry_msgs/Vector3 angular",
    "geometry_msgs/TwistStamped": "std_msgs/Header header; geometry_msgs/Twist twist",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist; float64[36] covariance",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
    "nav_msgs/Odometry": (
        "std_msgs/Header header; string child_frame_id; geometry_msgs/PoseWithCovariance pose; "
        "geometry_msgs/TwistWithCovariance twist"
    ),
    "nav_msgs/Path": "std_msgs/Header header; geometry_msgs/PoseStamped[] poses",
    "rcl_interfaces/Log": (
        "builtin_interfaces/Time stamp; uint8 level; string name; string msg; string file; string function; uint32 line"
    ),
    "rosgraph_msgs/Clock": "builtin_interfaces/Time clock",
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header; uint32 height; uint32 width; string distortion_model; float64[] d; "
        "float64[9] k; float64[9] r; float64[12] p; uint32 binning_x; uint32 binning_y; "
        "sensor_msgs/RegionOfInterest roi"
    ),
    "sensor_msgs/ChannelFloat32": "string name; float32[] values",
    "sensor_msgs/Image": (
        "std_msgs/Header header; uint32 height; uint32 width; string encoding; uint8 is_bigendian; "
        "uint32 step; uint8[] data"
    ),
    "sensor_msgs/Imu": (
        "std_msgs/Header header; geometry_msgs/Quaternion orientation; float64[9] orientation_covariance; "
        "geometry_msgs/Vector3 angular_velocity; float64[9] angular_velocity_covariance; "
        "geometry_msgs/Vector3 linear_acceleration; float64[9] linear_acceleration_covariance"
    ),
    "sensor_msgs/JointState": (
        "std_msgs/Header header; string[] name; float64[] position; float64[] velocity; float64[] effort"
    ),
    "sensor_msgs/LaserScan": (
        "std_msgs/Header header; float32 angle_min; float32 angle_max; float32 angle_increment; "
        "float32 time_increment; float32 scan_time; float32 range_min; float32 range_max; float32[] ranges; "
        "float32[] intensities"
    ),
    "sensor_msgs/PointCloud": (
        "std_msgs/Header header; geometry_msgs/Point32[] points; sensor_msgs/ChannelFloat32[] channels"
    ),
    "sensor_msgs/Range": (
        "std_msgs/Header header; uint8 radiation_type; float32 field_of_view; float32 min_range; "
        "float32 max_range; float32 range; float32 variance"
    ),
    "sensor_msgs/RegionOfInterest": "uint32 x_offset; uint32 y_offset; uint32 height; uint32 width; bool do_rectify",
    "std_msgs/Bool": "bool data",
    "std_msgs/Empty": "",
    "std_msgs/Float32": "float32 data",
    "std_msgs/Float64": "float64 data",
    "std_msgs/Header": "builtin_interfaces/Time stamp; string frame_id",
    "std_msgs/String": "string data",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}
"""Type and fields, separated by semicolons; without the constants, which are not part of a message."""
