"""The codec: records with ROS names as MessagePack maps, numeric arrays as one extension type."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

import msgspec
from msgspec import Meta

if TYPE_CHECKING:
    import numpy as np

Ext = msgspec.msgpack.Ext
"""A value of an extension type, as a decoder without a record yields it."""

ARRAY_CODE = 1
"""MessagePack extension type of an array: its data is the MessagePack array ``[dtype, shape, raw]``."""

MOST_DIMENSIONS = 3
"""No array on the wire has more."""
MOST_VALUES = 1 << 28
"""Bound of the product of an array's extents that are not 0: every shape within it is one that numpy takes."""

LARGEST = 1e12
"""Bound of every finite number on the wire; NaN and the infinities lie outside it."""


def _bounded(unit: str, limit: float = LARGEST) -> Meta:
    return Meta(ge=-limit, le=limit, extra={"unit": unit})


Finite = Annotated[float, _bounded("")]
Metres = Annotated[float, _bounded("m")]
Radians = Annotated[float, _bounded("rad")]
Nanoseconds = Annotated[int, Meta(ge=0, le=2**63 - 1, extra={"unit": "ns"})]
Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]


class Message(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """A record that travels on the wire as a map with the ROS field names.

    Every field has a default, as in ROS; unknown fields are ignored, so a newer sender is understood.
    ``ROS_TYPE`` names the type in the encoding of each sample.
    """

    ROS_TYPE: ClassVar[str] = ""


class WrongPayload(ValueError):
    """A payload is not the expected record; the text says which field and why."""


class Array:
    """A numeric array of one dtype; it keeps the raw bytes and becomes numpy only when asked.

    ``DTYPE`` is numpy's name of the little-endian element type.
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
        """Rebuild an array from the three parts of the extension; raises WrongPayload when they disagree."""
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

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Array) and (self.DTYPE, self.shape, self.raw) == (other.DTYPE, other.shape, other.raw)

    def __hash__(self) -> int:
        return hash((self.DTYPE, self.shape, self.raw))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.tolist()})"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        import numpy as np

        view = np.frombuffer(self.raw, self.DTYPE).reshape(self.shape)
        return np.array(view, dtype=dtype, copy=copy)

    def numpy(self) -> np.ndarray:
        """The values as a read-only numpy array of ``shape``."""
        return self.__array__()

    def tolist(self) -> list[float]:
        """The values as a flat list of Python numbers, in row-major order."""
        flat: array[float] = array(_TYPECODES[self.DTYPE], self.raw)
        if sys.byteorder == "big":
            flat.byteswap()
        return flat.tolist()


class Float64Array(Array):
    """ROS ``float64[]``."""

    __slots__ = ()


class Float32Array(Array):
    """ROS ``float32[]``."""

    DTYPE = "<f4"
    __slots__ = ()


Packed36 = Ext | Annotated[tuple[float, ...], Meta(min_length=36, max_length=36)]
"""ROS ``float64[36]``: a 6x6 matrix in row-major order over x, y, z, roll, pitch, yaw.

Our senders pack it as an array, which costs a tenth of 36 single numbers; a plain list of numbers is taken as well.
"""

Matrix3 = Annotated[tuple[float, ...], Meta(min_length=9, max_length=9)]
"""ROS ``float64[9]``: a 3x3 matrix in row-major order."""


M = TypeVar("M")
_TYPECODES = {"<f8": "d", "<f4": "f"}
_parts = msgspec.msgpack.Decoder(tuple[str, tuple[int, ...], bytes]).decode


def _to_plain(value: Any) -> object:
    if isinstance(value, Array):
        return Ext(ARRAY_CODE, msgspec.msgpack.encode((value.DTYPE, value.shape, value.raw)))
    if hasattr(value, "tolist"):  # numpy scalars and arrays, which control laws yield
        return value.tolist()
    raise NotImplementedError(f"{type(value).__name__} cannot be put in a message")


def _to_array(wanted: type, value: Any) -> object:
    if not issubclass(wanted, Array):
        raise NotImplementedError(f"no message may hold a {wanted.__name__}")
    if isinstance(value, Ext):
        if value.code != ARRAY_CODE:
            raise WrongPayload(f"unknown extension type {value.code}; only {ARRAY_CODE} (array) is known")
        try:
            parts = _parts(value.data)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise WrongPayload(f"expected an extension [dtype, shape, raw]: {error}") from None
        return wanted.from_wire(*parts)
    if isinstance(value, list) and all(type(each) in (int, float) for each in value):
        return wanted(value)
    raise WrongPayload(f"expected an array, got {type(value).__name__}")


FAULTS = (msgspec.MsgspecError, ValueError, RecursionError, OverflowError)
"""What a decoding function raises for a payload that is not the record, WrongPayload among them."""

encode: Callable[[object], bytes] = msgspec.msgpack.Encoder(enc_hook=_to_plain).encode
"""Encode one record as MessagePack bytes."""


def decoder(record: type[M]) -> Callable[[bytes], M]:
    """A function from MessagePack bytes to ``record``; it raises WrongPayload with the path of the field."""
    decode = bare_decoder(record)

    def checked(payload: bytes) -> M:
        try:
            return decode(payload)
        except FAULTS as error:
            raise WrongPayload(str(error)) from None

    return checked


def bare_decoder(record: type[M]) -> Callable[[bytes], M]:
    """As ``decoder``, but raising any of FAULTS; for who counts what is wrong and goes on."""
    return msgspec.msgpack.Decoder(record, dec_hook=_to_array).decode


def covariance(*variances: float) -> Ext:
    """The packed 6x6 matrix with the six given variances on its diagonal."""
    if len(variances) != 6:
        raise ValueError(f"a covariance diagonal has 6 values, got {len(variances)}")
    return pack36([variances[i // 7] if i % 7 == 0 else 0.0 for i in range(36)])


def pack36(values: Iterable[float]) -> Ext:
    """36 numbers as they travel."""
    packed = _to_plain(Float64Array(values))
    assert isinstance(packed, Ext)
    return packed


_PACKED_ZEROS = bytes(pack36([0.0] * 36).data)
_PACKED_SIZE, _PACKED_HEAD = len(_PACKED_ZEROS), _PACKED_ZEROS[: -8 * 36]


def check36(packed: Packed36) -> None:
    """Refuse what ``unpack36`` would refuse; what is packed as ours is known by its first bytes."""
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
    """The 36 numbers; raises WrongPayload when it is another array."""
    if not isinstance(packed, Ext):
        return packed
    array = _to_array(Float64Array, packed)
    assert isinstance(array, Float64Array)
    if array.shape not in ((36,), (6, 6)):
        raise WrongPayload(f"a covariance has 36 values, not an array of shape {array.shape}")
    return tuple(array.tolist())
