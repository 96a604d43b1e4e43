"""Definitions of ROS 2 message types: parsed from text, written as text, derived from records.

The standard ones are facts of rcl_interfaces, common_interfaces and geometry2 (Apache-2.0 and BSD-3-Clause); a test
compares the hash of each with that of an independent library. ``rosbags`` could parse the text, but it has no limits
for hostile definitions, takes 1.6 ms for an Odometry where ``parse`` takes 0.08, and needs four more packages.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import NamedTuple

import msgspec.inspect as kinds

from messages.base import Array, Float32Array, Message
from messages.errors import BadInput

SIZES = {
    "bool": ("?", 1),
    "byte": ("B", 1),
    "char": ("B", 1),
    "uint8": ("B", 1),
    "int8": ("b", 1),
    "uint16": ("H", 2),
    "int16": ("h", 2),
    "uint32": ("I", 4),
    "int32": ("i", 4),
    "uint64": ("Q", 8),
    "int64": ("q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
"""The ``struct`` code and the size in bytes of each number type."""

DEEPEST = 16
"""Maximum levels of nested types; ROS has five."""
LARGEST_LEAST = 1 << 26
"""Maximum bytes of the smallest message of a type, since its reader makes a value of each field."""

SEPARATOR = "=" * 80

_ALIASES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration", "Header": "std_msgs/Header"}
_TIME = "int32 sec\nuint32 nanosec"
_FIELD = re.compile(r"([A-Za-z][\w/]*)(<=\d+)?(?:\[(<=)?(\d{0,12})\])?\s+([A-Za-z]\w*)(?:\s+(?!=).*)?")
_CONSTANT = re.compile(r"[A-Za-z][\w/<=]*\s+\w+\s*=.*")


class Field(NamedTuple):
    """A field: ``extent`` is None for a single value, -1 for a sequence, else the length of an array.

    ``bound`` is the maximum length of a sequence, 0 without one.
    """

    name: str
    type: str
    extent: int | None = None
    bound: int = 0

    def __str__(self) -> str:
        match self.extent:
            case None:
                return f"{self.type} {self.name}"
            case -1:
                return f"{self.type}[{f'<={self.bound}' if self.bound else ''}] {self.name}"
            case length:
                return f"{self.type}[{length}] {self.name}"


Definitions = Mapping[str, tuple[Field, ...]]
"""Fields of each type in order, by name (``geometry_msgs/Pose``)."""


class BadDefinition(BadInput):
    """A text does not define a message type; the error says where."""


def parse(name: str, text: str) -> Definitions:
    """The type ``name`` and all types that it uses, from the text of an MCAP schema; raises BadDefinition.

    The definitions of the other types follow lines of ``=``, each under ``MSG: package/Type``.
    """
    found: dict[str, tuple[Field, ...]] = {}
    for number, section in enumerate(re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)):
        lines = section.strip("\n").splitlines()
        own = short_type_name(name)
        if number:
            head = lines.pop(0) if lines else ""
            if not head.startswith("MSG:"):
                raise BadDefinition(f"{name}: expected 'MSG: package/Type' after a separator, got {head[:80]!r}")
            own = short_type_name(head.removeprefix("MSG:").strip())
        found[own] = fields_in(own, lines)
    for time in ("builtin_interfaces/Time", "builtin_interfaces/Duration"):
        found.setdefault(time, fields_in(time, _TIME.splitlines()))
    _check(short_type_name(name), found, (), {})
    return found


def fields_in(owner: str, lines: Iterable[str]) -> tuple[Field, ...]:
    """The fields in the lines of the type ``owner``; raises BadDefinition."""
    return tuple(_fields(owner, lines))


def short_type_name(name: str) -> str:
    """``geometry_msgs/Pose`` for ``geometry_msgs/msg/Pose``."""
    return name.replace("/msg/", "/", 1)


def long_type_name(name: str) -> str:
    """``geometry_msgs/msg/Pose`` for ``geometry_msgs/Pose``; names such as ``pkg/srv/X_Request`` stay."""
    package, slash, own = name.partition("/")
    return f"{package}/msg/{own}" if slash and "/" not in own else name


def minimum_size(name: str, definitions: Definitions) -> int:
    """Bytes of the smallest value of a type without alignment, at least one."""
    if name in SIZES:
        return SIZES[name][1]
    return 4 if name == "string" else _minimum_size(name, definitions, {})


def text_of(name: str, definitions: Definitions) -> str:
    """The text of a type and all types that it uses, as ``parse`` reads it."""
    parts = []
    for each in closure(name, definitions):
        head = "" if each == name else f"MSG: {each}\n"
        parts.append(head + "".join(f"{field}\n" for field in definitions[each]))
    return f"{SEPARATOR}\n".join(parts)


def closure(name: str, definitions: Definitions) -> list[str]:
    """A type and all types that it uses, in the order of first use."""
    met = [name]
    for each in met:
        met += [kind for kind in dict.fromkeys(f.type for f in definitions[each]) if _complex(kind) and kind not in met]
    return met


def _complex(kind: str) -> bool:
    return kind not in SIZES and kind != "string"


def _fields(owner: str, lines: Iterable[str]) -> Iterator[Field]:
    package = owner.partition("/")[0]
    for line in lines:
        bare = line.partition("#")[0].strip()
        if not bare or _CONSTANT.fullmatch(bare):
            continue
        found = _FIELD.fullmatch(bare)
        if found is None:
            raise BadDefinition(f"{owner}: {line.strip()[:80]!r} is not a field")
        kind, _, bounded, length, name = found.groups()
        kind = _ALIASES.get(kind, short_type_name(kind))
        if _complex(kind) and "/" not in kind:
            kind = f"{package}/{kind}"
        count = None if length is None else -1 if bounded or not length else int(length)
        yield Field(name, kind, count, int(length) if bounded and length else 0)


def _check(name: str, definitions: Definitions, above: tuple[str, ...], depths: dict[str, int]) -> int:
    """Check a type once, however often it is used, and return its levels; raises BadDefinition."""
    if name in above or len(above) + depths.get(name, 0) > DEEPEST:
        raise BadDefinition(f"{name} holds itself, or types lie more than {DEEPEST} deep")
    if name in depths:
        return depths[name]
    if name not in definitions:
        raise BadDefinition(f"{above[-1] if above else name}: {name} is not defined")
    below = [0]
    for field in definitions[name]:
        if field.extent == 0:
            raise BadDefinition(f"{name}: '{field}' is an array of length 0")
        if _complex(field.type):
            below.append(1 + _check(field.type, definitions, (*above, name), depths))
    depths[name] = max(below)
    if not above and (size := _minimum_size(name, definitions, {})) > LARGEST_LEAST:
        raise BadDefinition(f"the smallest {name} has {size} bytes, the limit is {LARGEST_LEAST}")
    return depths[name]


def _minimum_size(name: str, definitions: Definitions, known: dict[str, int]) -> int:
    if name in known:
        return known[name]
    total = 0
    for field in definitions[name]:
        if field.extent == -1:
            total += 4
            continue
        one = (
            _minimum_size(field.type, definitions, known) if _complex(field.type) else SIZES.get(field.type, ("", 4))[1]
        )
        total += one * (1 if field.extent is None else field.extent)
    known[name] = max(1, total)
    return known[name]


STANDARD: dict[str, str] = {
    "actionlib_msgs/GoalID": "builtin_interfaces/Time stamp; string id",
    "actionlib_msgs/GoalStatus": "actionlib_msgs/GoalID goal_id; uint8 status; string text",
    "actionlib_msgs/GoalStatusArray": "std_msgs/Header header; actionlib_msgs/GoalStatus[] status_list",
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
    "sensor_msgs/CompressedImage": "std_msgs/Header header; string format; uint8[] data",
    "std_msgs/Bool": "bool data",
    "std_msgs/ColorRGBA": "float32 r; float32 g; float32 b; float32 a",
    "std_msgs/Empty": "",
    "std_msgs/Float32": "float32 data",
    "std_msgs/Float64": "float64 data",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout; float64[] data",
    "std_msgs/Header": "builtin_interfaces/Time stamp; string frame_id",
    "std_msgs/MultiArrayDimension": "string label; uint32 size; uint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim; uint32 data_offset",
    "std_msgs/String": "string data",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "visualization_msgs/Marker": (
        "std_msgs/Header header; string ns; int32 id; int32 type; int32 action; geometry_msgs/Pose pose; "
        "geometry_msgs/Vector3 scale; std_msgs/ColorRGBA color; builtin_interfaces/Duration lifetime; "
        "bool frame_locked; geometry_msgs/Point[] points; std_msgs/ColorRGBA[] colors; string texture_resource; "
        "sensor_msgs/CompressedImage texture; visualization_msgs/UVCoordinate[] uv_coordinates; string text; "
        "string mesh_resource; visualization_msgs/MeshFile mesh_file; bool mesh_use_embedded_materials"
    ),
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
    "visualization_msgs/MeshFile": "string filename; uint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u; float32 v",
    "trajectory_msgs/JointTrajectory": (
        "std_msgs/Header header; string[] joint_names; trajectory_msgs/JointTrajectoryPoint[] points"
    ),
    "trajectory_msgs/JointTrajectoryPoint": (
        "float64[] positions; float64[] velocities; float64[] accelerations; float64[] effort; "
        "builtin_interfaces/Duration time_from_start"
    ),
}
"""Fields of each type, separated by semicolons; constants are left out, as they are not part of a message."""


_WIDTHS = (("uint8", 0, 2**8 - 1), ("uint32", 0, 2**32 - 1), ("int32", -(2**31), 2**31 - 1))


@cache
def standard() -> Definitions:
    """ROS 2's own types, by name."""
    return {name: fields_in(name, fields.split("; ") if fields else []) for name, fields in STANDARD.items()}


@cache
def definitions(record: type[Message]) -> Definitions:
    """The type of a record and all types that it uses, by name."""
    found = dict(standard())
    _derive(record, found)
    return {name: found[name] for name in closure(record.ROS_TYPE, found)}


def fields_of(record: type[Message]) -> dict[str, kinds.Field]:
    """The fields of a record by their names on the wire."""
    info = kinds.type_info(record)
    assert isinstance(info, kinds.StructType)
    return {field.encode_name: field for field in info.fields}


def unwrap(kind: kinds.Type) -> kinds.Type:
    """A field's type without unit and description."""
    return unwrap(kind.type) if isinstance(kind, kinds.Metadata) else kind


def record_of(kind: kinds.Type) -> type[Message] | None:
    """The record class of a field that holds a record, else None."""
    return kind.cls if isinstance(kind, kinds.StructType) and issubclass(kind.cls, Message) else None


def optional(kind: kinds.Type) -> kinds.Type | None:
    """``X`` of ``X | None``; None for every other type."""
    if isinstance(kind, kinds.UnionType) and len(kind.types) == 2:
        rest = [each for each in kind.types if not isinstance(each, kinds.NoneType)]
        return unwrap(rest[0]) if len(rest) == 1 else None
    return None


def anything(kind: kinds.Type) -> bool:
    """Whether a field holds a parameter's value, whose type is only known on arrival."""
    return isinstance(kind, kinds.UnionType) and optional(kind) is None and not packed(kind)


def packed(kind: kinds.Type) -> bool:
    """Whether a field is a ``Packed36``."""
    return isinstance(kind, kinds.UnionType) and any(isinstance(each, kinds.ExtType) for each in kind.types)


def _derive(record: type[Message], found: dict[str, tuple[Field, ...]]) -> None:
    if record.ROS_TYPE in found:
        return
    found[record.ROS_TYPE] = tuple(_field(name, unwrap(each.type), found) for name, each in fields_of(record).items())


def _field(name: str, kind: kinds.Type, found: dict[str, tuple[Field, ...]]) -> Field:
    if (inner := optional(kind)) is not None:
        return Field(name, _single(inner, found), -1, 1)
    match kind:
        case kinds.VarTupleType(item_type=item, min_length=low, max_length=high):
            return Field(name, _single(unwrap(item), found), low if low is not None and low == high else -1)
        case kinds.CustomType(cls=cls) if issubclass(cls, Array):
            return Field(name, "float32" if issubclass(cls, Float32Array) else "float64", -1)
        case kinds.BytesType():
            return Field(name, "uint8", -1)
    if packed(kind):
        return Field(name, "float64", 36)
    return Field(name, _single(kind, found))


def _single(kind: kinds.Type, found: dict[str, tuple[Field, ...]]) -> str:
    if (nested := record_of(kind)) is not None:
        _derive(nested, found)
        return nested.ROS_TYPE
    match kind:
        case kinds.BoolType():
            return "bool"
        case kinds.IntType(ge=low, le=high):
            return next((name for name, least, most in _WIDTHS if _within(low, high, least, most)), "int64")
        case kinds.FloatType():
            return "float64"
        case kinds.StrType() | kinds.LiteralType():
            return "string"
    if anything(kind):
        return "string"
    raise TypeError(f"no ROS type for a field of {kind}")


def _within(low: int | None, high: int | None, least: int, most: int) -> bool:
    return low is not None and high is not None and least <= low and high <= most
