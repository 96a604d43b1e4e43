"""std_msgs and builtin_interfaces: time, headers and single values."""

from typing import Annotated, ClassVar, Self

from msgspec import Meta

from messages.base import LARGEST, Finite, Message, NameStr

SECOND = 1_000_000_000
"""Nanoseconds in a second."""

Shade = Annotated[float, Meta(ge=0, le=1)]


class Time(Message, frozen=True, kw_only=True):
    """A point in simulation time."""

    ROS_TYPE: ClassVar[str] = "builtin_interfaces/Time"
    sec: Annotated[int, Meta(ge=-(2**31), le=2**31 - 1, extra={"unit": "s"})] = 0
    nanosec: Annotated[int, Meta(ge=0, lt=SECOND, extra={"unit": "ns"})] = 0

    @classmethod
    def of(cls, nanoseconds: int) -> Self:
        """Return the time ``nanoseconds`` after the start of the simulation."""
        return cls(sec=nanoseconds // SECOND, nanosec=nanoseconds % SECOND)

    @property
    def ns(self) -> int:
        """Nanoseconds since the start of the simulation."""
        return self.sec * SECOND + self.nanosec


class Duration(Message, frozen=True, kw_only=True):
    """A span of simulation time; if negative, ``sec`` is negative and ``nanosec`` counts up from it."""

    ROS_TYPE: ClassVar[str] = "builtin_interfaces/Duration"
    sec: Annotated[int, Meta(ge=-(2**31), le=2**31 - 1, extra={"unit": "s"})] = 0
    nanosec: Annotated[int, Meta(ge=0, lt=SECOND, extra={"unit": "ns"})] = 0

    @classmethod
    def of(cls, nanoseconds: int) -> Self:
        """Return the span of ``nanoseconds``."""
        return cls(sec=nanoseconds // SECOND, nanosec=nanoseconds % SECOND)

    @property
    def ns(self) -> int:
        """The length in nanoseconds."""
        return self.sec * SECOND + self.nanosec


class Header(Message, frozen=True, kw_only=True):
    """Time and frame of the data."""

    ROS_TYPE: ClassVar[str] = "std_msgs/Header"
    stamp: Time = Time()
    frame_id: str = ""


def stamp_of(message: object) -> int | None:
    """Return the simulation time [ns] of a message: from its header, its first transform's header, or its clock.

    A header without a stamp yields 0; None for a message without any of these.
    """
    transforms = getattr(message, "transforms", ())
    header = getattr(transforms[0] if transforms else message, "header", None)
    if isinstance(header, Header):
        return header.stamp.ns
    clock = getattr(message, "clock", None)
    return clock.ns if isinstance(clock, Time) else None


class String(Message, frozen=True, kw_only=True):
    """A text."""

    ROS_TYPE: ClassVar[str] = "std_msgs/String"
    data: str = ""


class Bool(Message, frozen=True, kw_only=True):
    """A boolean."""

    ROS_TYPE: ClassVar[str] = "std_msgs/Bool"
    data: bool = False


class Float32(Message, frozen=True, kw_only=True):
    """A number; encoded as a double on the bus, exported as a float."""

    ROS_TYPE: ClassVar[str] = "std_msgs/Float32"
    data: Annotated[float, Meta(ge=-3.4028235e38, le=3.4028235e38)] = 0.0


class Float64(Message, frozen=True, kw_only=True):
    """A number."""

    ROS_TYPE: ClassVar[str] = "std_msgs/Float64"
    data: Annotated[float, Meta(ge=-LARGEST, le=LARGEST)] = 0.0


class ColorRGBA(Message, frozen=True, kw_only=True):
    """A colour and its opacity, each from 0 to 1."""

    ROS_TYPE: ClassVar[str] = "std_msgs/ColorRGBA"
    r: Shade = 0.0
    g: Shade = 0.0
    b: Shade = 0.0
    a: Shade = 0.0


class MultiArrayDimension(Message, frozen=True, kw_only=True):
    """One dimension of a multi-array: its label, its size, and the number of values per step along it."""

    ROS_TYPE: ClassVar[str] = "std_msgs/MultiArrayDimension"
    label: NameStr = ""
    size: Annotated[int, Meta(ge=0, lt=2**32)] = 0
    stride: Annotated[int, Meta(ge=0, lt=2**32)] = 0


class MultiArrayLayout(Message, frozen=True, kw_only=True):
    """The dimensions of a multi-array, outermost first; publishers of plain lists leave it empty."""

    ROS_TYPE: ClassVar[str] = "std_msgs/MultiArrayLayout"
    dim: tuple[MultiArrayDimension, ...] = ()
    data_offset: Annotated[int, Meta(ge=0, lt=2**32)] = 0


class Float64MultiArray(Message, frozen=True, kw_only=True):
    """A list of numbers; group controllers expect one per joint, in the order of their joints."""

    ROS_TYPE: ClassVar[str] = "std_msgs/Float64MultiArray"
    layout: MultiArrayLayout = MultiArrayLayout()
    data: tuple[Finite, ...] = ()


class Empty(Message, frozen=True, kw_only=True):
    """An empty message; the request of services without arguments."""

    ROS_TYPE: ClassVar[str] = "std_msgs/Empty"
