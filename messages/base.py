"""The codec: records with ROS names as MessagePack maps, numeric arrays as one extension type."""

from __future__ import annotations

import sys
import threading
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, SupportsIndex, TypeVar, overload

import msgspec
from msgspec import Meta

from messages.errors import EleaError

if TYPE_CHECKING:
    import numpy as np

Ext = msgspec.msgpack.Ext
"""A value of an extension type, as decoded without a record type."""

ARRAY_CODE = 1
"""MessagePack extension type of an array: its data is the MessagePack array ``[dtype, shape, raw]``."""

MOST_DIMENSIONS = 3
"""Maximum number of dimensions of an array on the wire."""
MOST_VALUES = 1 << 28
"""Maximum product of an array's nonzero extents; numpy accepts every shape within it."""

LARGEST = 1e12
"""Maximum magnitude of a ``Finite`` number on the wire; NaN and the infinities exceed it."""


def _bounded(unit: str, limit: float = LARGEST) -> Meta:
    return Meta(ge=-limit, le=limit, extra={"unit": unit})


Finite = Annotated[float, _bounded("")]
Metres = Annotated[float, _bounded("m")]
Radians = Annotated[float, _bounded("rad")]
Nanoseconds = Annotated[int, Meta(ge=0, le=2**63 - 1, extra={"unit": "ns"})]
MOST_COUNTED = 2**63 - 1
Count = Annotated[int, Meta(ge=0, le=MOST_COUNTED)]


def saturating_add(count: int, more: int) -> int:
    """Add ``more`` to a counter, which saturates at the largest ``Count``."""
    return min(count + more, MOST_COUNTED)


NameStr = Annotated[str, Meta(max_length=255)]
"""A ROS name: of a model, joint, link, frame, node, topic or parameter."""
ScopedName = Annotated[str, Meta(max_length=512)]
"""Two names, as in ``model::link``."""

MOST_ITEMS = 1000
"""Maximum length of the lists in a request."""


class Message(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """A record that is encoded as a map with the ROS field names.

    Every field has a default, as in ROS; unknown fields are ignored, so messages of a newer publisher can be decoded.
    ``ROS_TYPE`` names the type in the encoding of each sample.
    """

    ROS_TYPE: ClassVar[str] = ""


class WrongPayload(EleaError, ValueError):
    """A payload is not the expected record; the text names the field and the reason."""


class Array:
    """A numeric array of one dtype: a sequence of Python numbers or, with more than one dimension, of arrays.

    It keeps the raw bytes and converts them on access to Python numbers, or without a copy to numpy (``numpy()``,
    ``numpy.asarray``). It equals another array of the same dtype and shape with the same bytes, and a list or tuple of
    equal numbers. ``DTYPE`` is numpy's name of the little-endian element type.
    """

    DTYPE: ClassVar[str] = "<f8"
    __slots__ = ("raw", "shape")

    def __init__(self, values: Iterable[float] | np.ndarray = (), shape: tuple[int, ...] | None = None) -> None:
        given: Any = values
        if hasattr(given, "astype"):
            self.raw: bytes = given.astype(self.DTYPE).tobytes()
            self.shape: tuple[int, ...] = given.shape
        else:
            flat = array(_TYPECODES[self.DTYPE], given)
            if sys.byteorder == "big":
                flat.byteswap()
            self.raw, self.shape = flat.tobytes(), (len(flat),)
        if shape is not None:
            self.shape = shape
        self._check()

    @classmethod
    def from_wire(cls, dtype: str, shape: Iterable[int], raw: bytes) -> Self:
        """Rebuild an array from the three parts of the extension; raises WrongPayload if they disagree."""
        if dtype != cls.DTYPE:
            raise WrongPayload(f"expected an array of {cls.DTYPE}, got {dtype}")
        made = cls.__new__(cls)
        made.raw, made.shape = bytes(raw), tuple(shape)
        made._check()
        return made

    def _check(self) -> None:
        if len(self.shape) > MOST_DIMENSIONS:
            raise WrongPayload(f"an array has at most {MOST_DIMENSIONS} dimensions, got {len(self.shape)}")
        count, room = 1, 1
        for extent in self.shape:
            if extent < 0:
                raise WrongPayload(f"an array cannot have the shape {self.shape}")
            count *= extent
            room *= extent or 1
        if room > MOST_VALUES:
            raise WrongPayload(f"an array has at most {MOST_VALUES} values, got the shape {self.shape}")
        if count * int(self.DTYPE[-1]) != len(self.raw):
            raise WrongPayload(f"{len(self.raw)} bytes are not an array of {self.DTYPE} of shape {self.shape}")

    def __len__(self) -> int:
        return self.shape[0] if self.shape else 1

    def __iter__(self) -> Iterator[Any]:
        return iter(self._numbers()) if len(self.shape) == 1 else (self[index] for index in range(len(self)))

    def __reversed__(self) -> Iterator[Any]:
        return (self[index] for index in range(len(self) - 1, -1, -1))

    @overload
    def __getitem__(self, index: slice) -> Self: ...

    @overload
    def __getitem__(self, index: SupportsIndex) -> Any: ...

    def __getitem__(self, index: SupportsIndex | slice) -> Any:
        """Return an element; for a slice, an array of the same type."""
        if not self.shape:
            raise TypeError("an array without dimensions has no elements")
        rows = range(self.shape[0])
        if not isinstance(index, slice):
            if len(self.shape) == 1:
                return self._numbers()[index]
            return self._part((rows[index],), self.shape[1:])
        chosen = rows[index]
        return self._part(chosen, (len(chosen), *self.shape[1:]))

    def __contains__(self, value: object) -> bool:
        return any(value is each or value == each for each in self)

    def index(self, value: object) -> int:
        """Return the index of the first element that equals ``value``; raises ValueError if there is none."""
        for place, each in enumerate(self):
            if value is each or value == each:
                return place
        raise ValueError(f"{value!r} is not in the array")

    def count(self, value: object) -> int:
        """Count the elements that equal ``value``."""
        return sum(value is each or value == each for each in self)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Array):
            return (self.DTYPE, self.shape, self.raw) == (other.DTYPE, other.shape, other.raw)
        if isinstance(other, list | tuple):
            return len(self) == len(other) and all(one == two for one, two in zip(self, other, strict=True))
        return NotImplemented

    def __hash__(self) -> int:
        return hash((self.DTYPE, self.shape, self.raw))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.tolist()})"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        import numpy as np

        view = np.frombuffer(self.raw, self.DTYPE).reshape(self.shape)
        return np.array(view, dtype=dtype, copy=copy)

    def numpy(self) -> np.ndarray:
        """Return the values as a read-only numpy array of ``shape``."""
        return self.__array__()

    def tolist(self) -> list[float]:
        """Return the values as a flat list of Python numbers, in row-major order."""
        values: list[float] = [*self._numbers()]
        return values

    def _numbers(self) -> memoryview[float] | array[float]:
        """Return the values as a flat sequence."""
        if sys.byteorder == "little":
            return memoryview(self.raw).cast(_TYPECODES[self.DTYPE])
        flat: array[float] = array(_TYPECODES[self.DTYPE], self.raw)
        flat.byteswap()
        return flat

    def _part(self, rows: Sequence[int], shape: tuple[int, ...]) -> Self:
        """Return the array of the given rows."""
        size = len(self.raw) // self.shape[0] if self.shape[0] else 0
        part = type(self).__new__(type(self))
        part.raw, part.shape = b"".join([self.raw[row * size : (row + 1) * size] for row in rows]), shape
        return part


Sequence.register(Array)


class Float64Array(Array):
    """ROS ``float64[]``."""

    __slots__ = ()


class Float32Array(Array):
    """ROS ``float32[]``."""

    DTYPE = "<f4"
    __slots__ = ()


def ensure_array(record: Message, field: str, array_type: type[Array]) -> Array:
    """Return the array in a field of a frozen record; a list or numpy array there is converted and replaced first.

    For ``__post_init__`` of records with arrays. Raises what ``Array`` raises for values that are not numbers.
    """
    value = getattr(record, field)
    if isinstance(value, Array):
        return value
    made = array_type(value)
    msgspec.structs.force_setattr(record, field, made)
    return made


Packed36 = Ext | Annotated[tuple[float, ...], Meta(min_length=36, max_length=36)]
"""ROS ``float64[36]``: a 6x6 matrix in row-major order over x, y, z, roll, pitch, yaw.

Our publishers pack it as an array, which costs a tenth of encoding 36 single numbers; a plain list of numbers is
accepted too.
"""

Matrix3 = Annotated[tuple[float, ...], Meta(min_length=9, max_length=9)]
"""ROS ``float64[9]``: a 3x3 matrix in row-major order."""


M = TypeVar("M")
_TYPECODES: dict[str, Literal["d", "f"]] = {"<f8": "d", "<f4": "f"}
_HEADS: dict[tuple[type, int], tuple[bytes, tuple[int, ...]]] = {}
"""Headers of validated arrays, by type and size of the extension: the bytes before the values, and the shape. A robot
has few array sizes, and decoding with this cache takes a third of the time of parsing ``[dtype, shape, raw]``."""
_MOST_HEADS = 64
_NO_HEAD: tuple[bytes, tuple[int, ...]] = b"", ()
_parts = msgspec.msgpack.Decoder(tuple[str, tuple[int, ...], bytes]).decode


def pack_array(dtype: str, shape: tuple[int, ...], raw: bytes) -> Ext:
    """Return the extension for an array given as the little-endian bytes of its values."""
    return Ext(ARRAY_CODE, msgspec.msgpack.encode((dtype, shape, raw)))


def _to_plain(value: Any) -> object:
    if isinstance(value, Array):
        return pack_array(value.DTYPE, value.shape, value.raw)
    if hasattr(value, "tolist"):  # numpy scalars and arrays, which controllers return
        return value.tolist()
    raise NotImplementedError(f"{type(value).__name__} cannot be put in a message")


def _to_array(array_type: type, value: Any) -> object:
    """Decoder hook for arrays; for an extension seen before, only its first bytes and its size are compared."""
    if type(value) is Ext:
        data: Any = value.data  # bytes or a view of them
        head, shape = _HEADS.get((array_type, len(data)), _NO_HEAD)
        if head and value.code == ARRAY_CODE and data[: len(head)] == head:
            made: Any = object.__new__(array_type)
            made.raw, made.shape = bytes(data[len(head) :]), shape
            return made
    if not issubclass(array_type, Array):
        raise NotImplementedError(f"no message may hold a {array_type.__name__}")
    if isinstance(value, Ext):
        if value.code != ARRAY_CODE:
            raise WrongPayload(f"unknown extension type {value.code}; only {ARRAY_CODE} (array) is known")
        try:
            parts = _parts(value.data)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise WrongPayload(f"expected an extension [dtype, shape, raw]: {error}") from None
        read = array_type.from_wire(*parts)
        _remember(read, bytes(value.data))
        return read
    if isinstance(value, list) and {int, float}.issuperset(map(type, value)):
        return array_type(value)
    raise WrongPayload(f"expected an array, got {type(value).__name__}")


def _remember(read: Array, data: bytes) -> None:
    """Cache the header of a valid array: others of this type and size with the same leading bytes are valid too."""
    if len(_HEADS) >= _MOST_HEADS:
        _HEADS.clear()
    _HEADS[type(read), len(data)] = data[: len(data) - len(read.raw)], read.shape


DECODE_ERRORS = (msgspec.MsgspecError, ValueError, RecursionError, OverflowError)
"""Exceptions of a decoding function for a payload that is not the record, including WrongPayload."""

encode: Callable[[object], bytes] = msgspec.msgpack.Encoder(enc_hook=_to_plain).encode
"""Encode one record as MessagePack bytes."""


_BUILDING = threading.Lock()
"""Held while msgspec inspects the fields of a record: it exposes them to other threads before their types are resolved,
and a thread that decodes such a record in the meantime crashes the process."""


def decoder(record: type[M]) -> Callable[[bytes], M]:
    """Return a decoder of MessagePack bytes to ``record``; it raises WrongPayload with the path of the field."""
    decode = raw_decoder(record)

    def checked(payload: bytes) -> M:
        try:
            return decode(payload)
        except DECODE_ERRORS as error:
            raise WrongPayload(str(error)) from None

    return checked


def raw_decoder(record: type[M]) -> Callable[[bytes], M]:
    """Like ``decoder`` without wrapping errors; catch DECODE_ERRORS. For hot paths."""
    with _BUILDING:
        return msgspec.msgpack.Decoder(record, dec_hook=_to_array).decode


def covariance(*variances: float) -> Ext:
    """Pack the 6x6 matrix with the six given variances on its diagonal."""
    if len(variances) != 6:
        raise ValueError(f"a covariance diagonal has 6 values, got {len(variances)}")
    return pack36([variances[i // 7] if i % 7 == 0 else 0.0 for i in range(36)])


def pack36(values: Iterable[float]) -> Ext:
    """Pack 36 numbers as an array."""
    packed = _to_plain(Float64Array(values))
    assert isinstance(packed, Ext)
    return packed


_PACKED_ZEROS = bytes(pack36([0.0] * 36).data)
_PACKED_SIZE, _PACKED_HEAD = len(_PACKED_ZEROS), _PACKED_ZEROS[: -8 * 36]


def check36(packed: Packed36) -> None:
    """Raise WrongPayload if ``unpack36`` would; a covariance packed as ours is recognised by its first bytes."""
    if type(packed) is not Ext:
        return
    data: Any = packed.data  # bytes or a view of them
    if packed.code == ARRAY_CODE and len(data) == _PACKED_SIZE and data[: len(_PACKED_HEAD)] == _PACKED_HEAD:
        return
    try:
        unpack36(packed)
    except WrongPayload as error:
        raise WrongPayload(f"covariance: {error}") from None


def unpack36(packed: Packed36) -> tuple[float, ...]:
    """Return the 36 numbers; raises WrongPayload for any other array."""
    if not isinstance(packed, Ext):
        return packed
    array = _to_array(Float64Array, packed)
    assert isinstance(array, Float64Array)
    if array.shape not in ((36,), (6, 6)):
        raise WrongPayload(f"a covariance has 36 values, not an array of shape {array.shape}")
    return tuple(array.tolist())
