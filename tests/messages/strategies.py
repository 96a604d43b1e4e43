"""Hypothesis strategies for every record, derived from its annotated field types, and the records as plain values."""

from functools import cache
from typing import Any

import msgpack
import msgspec
import msgspec.inspect as kinds
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from messages.base import Array, Float32Array, Message, pack36
from messages.geometry import FASTEST_ANGULAR, FASTEST_LINEAR, Twist, Vector3
from messages.sensor import ChannelFloat32, Image, JointState, LaserScan, PointCloud

DETERMINISTIC = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], database=None
)
"""The same examples in every run, regardless of the machine's load."""
FEW = settings(DETERMINISTIC, max_examples=8)
"""Settings for tests of each of 200 records, most of whose fields have the same few types."""


@cache
def values(record: type[Message]) -> st.SearchStrategy[Any]:
    """Return a strategy for all valid values of a record."""
    fields = {field.name: of_kind(field.type) for field in struct(record).fields}
    if record in _DEPENDENT_FIELDS:
        return _DEPENDENT_FIELDS[record](fields)
    return st.builds(record, **fields)


@cache
def struct(record: type[Message]) -> kinds.StructType:
    """Return msgspec's type information of a record."""
    found = kinds.type_info(record)
    assert isinstance(found, kinds.StructType)
    return found


def bare(kind: kinds.Type) -> kinds.Type:
    """Return a field type without its unit and description."""
    return bare(kind.type) if isinstance(kind, kinds.Metadata) else kind


def of_kind(kind: kinds.Type) -> st.SearchStrategy[Any]:
    """Return a strategy for all valid values of a field type, within its bounds."""
    match bare(kind):
        case kinds.StructType(cls=cls) if issubclass(cls, Message):
            return values(cls)
        case kinds.FloatType(ge=low, le=high):
            return st.floats(low, high, allow_nan=False)
        case kinds.IntType() as whole:
            return st.integers(*_int_bounds(whole))
        case kinds.BoolType():
            return st.booleans()
        case kinds.StrType(pattern=str() as pattern, max_length=int() as longest):
            return st.from_regex(pattern, fullmatch=True).map(lambda text: text[:longest])
        case kinds.StrType():
            return st.text(max_size=30)
        case kinds.BytesType():
            return st.binary(max_size=100)
        case kinds.NoneType():
            return st.none()
        case kinds.LiteralType(values=allowed):
            return st.sampled_from(allowed)
        case kinds.ExtType():
            return st.lists(st.floats(-1e12, 1e12), min_size=36, max_size=36).map(pack36)
        case kinds.UnionType(types=types):
            return st.one_of(*map(of_kind, types))
        case kinds.VarTupleType(item_type=item, min_length=low, max_length=high):
            return st.lists(
                of_kind(item), min_size=low or 0, max_size=4 if high is None else max(low or 0, min(high, 4))
            ).map(tuple)
        case kinds.CustomType(cls=cls) if issubclass(cls, Array):
            return _arrays(cls)
    raise AssertionError(f"no strategy for {kind}")


def plain(value: Any) -> Any:
    """Convert a value to what any MessagePack library must decode: maps, lists and numpy arrays."""
    if isinstance(value, Message):
        names = zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True)
        return {wire: plain(getattr(value, name)) for name, wire in names}
    if isinstance(value, tuple):
        return [plain(each) for each in value]
    if isinstance(value, msgspec.msgpack.Ext):
        return read_array(value.code, value.data)
    return value.numpy() if isinstance(value, Array) else value


def unpack(payload: bytes) -> Any:
    """Decode a payload with the independent library."""
    return msgpack.unpackb(payload, ext_hook=read_array)


def read_array(code: int, data: bytes) -> Any:
    """Decode extension 1 as a foreign program must."""
    assert code == 1
    dtype, shape, raw = msgpack.unpackb(data)
    return np.frombuffer(raw, dtype).reshape(shape)


def write_array(array: Any) -> msgpack.ExtType:
    """Encode an array as extension 1."""
    return msgpack.ExtType(1, msgpack.packb([array.dtype.str, array.shape, array.tobytes()]))


def _int_bounds(kind: kinds.IntType) -> tuple[int, int]:
    low = kind.ge if kind.ge is not None else -(2**63) if kind.gt is None else kind.gt + 1
    high = kind.le if kind.le is not None else 2**64 - 1 if kind.lt is None else kind.lt - 1
    return low, high


def _arrays(cls: type[Array], size: int | None = None) -> st.SearchStrategy[Any]:
    number = st.floats(width=int(cls.DTYPE[-1]) * 8)  # type: ignore[arg-type]
    return st.lists(number, min_size=size or 0, max_size=20 if size is None else size).map(cls)


def _twists(_: dict[str, Any]) -> st.SearchStrategy[Any]:
    def vectors(limit: float) -> st.SearchStrategy[Vector3]:
        return st.builds(Vector3, **dict.fromkeys("xyz", st.floats(-limit, limit)))

    return st.builds(Twist, linear=vectors(FASTEST_LINEAR), angular=vectors(FASTEST_ANGULAR))


def _joint_states(fields: dict[str, Any]) -> st.SearchStrategy[Any]:
    def of_names(names: list[str]) -> st.SearchStrategy[Any]:
        finite = st.floats(-1e12, 1e12)
        part = st.sampled_from((0, len(names))).flatmap(lambda n: st.lists(finite, min_size=n, max_size=n).map(tuple))
        return st.builds(
            JointState, header=fields["header"], name=st.just(tuple(names)), position=part, velocity=part, effort=part
        )

    return st.lists(st.text(max_size=9), max_size=4).flatmap(of_names)


def _scans(fields: dict[str, Any]) -> st.SearchStrategy[Any]:
    def of_ranges(ranges: Any) -> st.SearchStrategy[Any]:
        intensities = st.sampled_from((0, len(ranges))).flatmap(lambda n: _arrays(type(ranges), n))
        return st.builds(LaserScan, **{**fields, "ranges": st.just(ranges), "intensities": intensities})

    return fields["ranges"].flatmap(of_ranges)  # type: ignore[no-any-return]


def _images(fields: dict[str, Any]) -> st.SearchStrategy[Any]:
    def of_size(size: tuple[int, int]) -> st.SearchStrategy[Any]:
        height, step = size
        data = st.binary(min_size=height * step, max_size=height * step)
        return st.builds(Image, **{**fields, "height": st.just(height), "step": st.just(step), "data": data})

    return st.tuples(st.integers(0, 6), st.integers(0, 30)).flatmap(of_size)


def _clouds(fields: dict[str, Any]) -> st.SearchStrategy[Any]:
    def of_points(points: Any) -> st.SearchStrategy[Any]:
        channel = st.builds(ChannelFloat32, name=st.text(max_size=9), values=_arrays(Float32Array, len(points)))
        channels = st.lists(channel, max_size=3).map(tuple)
        return st.builds(PointCloud, header=fields["header"], points=st.just(points), channels=channels)

    return fields["points"].flatmap(of_points)  # type: ignore[no-any-return]


_DEPENDENT_FIELDS = {Twist: _twists, JointState: _joint_states, LaserScan: _scans, Image: _images, PointCloud: _clouds}
"""Strategies for records whose fields depend on each other."""
