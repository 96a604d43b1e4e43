"""The protocol between the page and the panel: client messages, channels, and the binary packet of plot samples.

Little-endian: four uint32 (MAGIC, the epoch of simulation time, the number of series, 0); then for each series two
uint32 (its id, the number of samples), its times [s of simulation time] and its values, float64 each. Everything is
aligned to 8 bytes, as a browser's typed arrays require.
"""

from __future__ import annotations

import struct
import sys
from array import array
from collections.abc import Iterable
from typing import Annotated, Literal, Protocol

import msgspec
from msgspec import Meta

from messages.names import BadName
from messages.names import key as absolute
from messages.parameters import SetName, Value
from services.runtime.errors import BadInput
from services.runtime.field_path import parse_path

MAX_MESSAGE_SIZE = 1 << 16
"""Maximum bytes of a page's message; a larger one ends the connection."""

MAX_SERIES = 32

Name = Annotated[str, Meta(max_length=255)]
Number = Annotated[float, Meta(ge=-1e6, le=1e6)]
Id = Annotated[int, Meta(ge=0, le=2**31)]
ChannelName = Literal[
    "clock",
    "fleet",
    "graph",
    "rates",
    "log",
    "poses",
    "robots",
    "sets",
    "values",
    "world",
    "bodies",
    "markers",
]


class ClientMessageBase(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="k", tag=str.lower
):
    """Base class of a page's messages."""


class PlotSeries(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One field of one topic to plot; ``id`` is the page's own number for it."""

    id: Id
    topic: Name
    path: Name


class Subscribe(ClientMessageBase, frozen=True, kw_only=True):
    """Everything that the page shows from now on; ``fields`` are topics whose fields it lists, ``scan`` is the
    namespace of the robot whose laser scan it draws."""

    channels: Annotated[tuple[ChannelName, ...], Meta(max_length=16)] = ()
    series: Annotated[tuple[PlotSeries, ...], Meta(max_length=MAX_SERIES)] = ()
    fields: Annotated[tuple[Name, ...], Meta(max_length=4)] = ()
    scan: Name = ""


class Drive(ClientMessageBase, frozen=True, kw_only=True):
    """A velocity command [m/s, rad/s], repeated while the joystick is held."""

    robot: Name
    v: Number = 0.0
    w: Number = 0.0


class Release(ClientMessageBase, frozen=True, kw_only=True):
    """The joystick is released."""


class ClientRequest(ClientMessageBase, frozen=True, kw_only=True):
    """Base class of messages that get a reply with the same ``id``."""

    id: Id


class Pause(ClientRequest, frozen=True, kw_only=True):
    """Stop simulation time."""


class Resume(ClientRequest, frozen=True, kw_only=True):
    """Resume simulation time."""


class Step(ClientRequest, frozen=True, kw_only=True):
    """Run some physics steps while paused."""

    count: Annotated[int, Meta(ge=1, le=2000)] = 1


class Reset(ClientRequest, frozen=True, kw_only=True):
    """Move all models to where they were spawned; with ``time``, also reset simulation time."""

    time: bool = True


class Process(ClientRequest, frozen=True, kw_only=True):
    """A request to the supervisor to start, stop or restart a process."""

    verb: Literal["start", "stop", "restart"]
    name: Name


class Set(ClientRequest, frozen=True, kw_only=True):
    """Set parameters of a set, all or none; with ``run`` for this run only."""

    set: SetName
    values: Annotated[dict[str, Value], Meta(min_length=1, max_length=256)]
    run: bool = False


class Unset(ClientRequest, frozen=True, kw_only=True):
    """Reset the named parameters of a set, all if none is named."""

    set: SetName
    names: Annotated[tuple[Name, ...], Meta(max_length=256)] = ()


class Undo(ClientRequest, frozen=True, kw_only=True):
    """Undo the newest change of a set."""

    set: SetName


class History(ClientRequest, frozen=True, kw_only=True):
    """List the newest changes of a set."""

    set: SetName
    limit: Annotated[int, Meta(ge=1, le=200)] = 30


class Goal(ClientRequest, frozen=True, kw_only=True):
    """Send a robot to a pose in the world frame [m, m, rad]."""

    robot: Name
    x: Annotated[float, Meta(ge=-1e4, le=1e4)]
    y: Annotated[float, Meta(ge=-1e4, le=1e4)]
    yaw: Annotated[float, Meta(ge=-100, le=100)] = 0.0


class Estop(ClientRequest, frozen=True, kw_only=True):
    """Stop a robot, or all if ``robot`` is empty, until ``on=false`` resets the stop."""

    robot: Name = ""
    on: bool


ClientMessage = (
    Subscribe | Drive | Release | Pause | Resume | Step | Reset | Process | Set | Unset | Undo | History | Goal | Estop
)

_decoder: msgspec.json.Decoder[ClientMessage] = msgspec.json.Decoder(ClientMessage)


def decode_message(text: str) -> ClientMessage:
    """Decode and check a page's message; raises BadInput with the field and the reason."""
    try:
        message = _decoder.decode(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeEncodeError) as error:
        raise BadInput(f"invalid message: {error}") from None
    match message:
        case Subscribe():
            for series in message.series:
                _check_name(series.topic)
                parse_path(series.path)
            for topic in message.fields:
                _check_name(topic)
        case Drive(robot=robot) | Goal(robot=robot):
            _check_name(robot)
        case Estop(robot=robot) if robot:
            _check_name(robot)
        case Set(set=name) | Unset(set=name) | Undo(set=name) | History(set=name):
            _check_name(name)
    return message


def _check_name(name: str) -> None:
    try:
        absolute(name)
    except BadName as error:
        raise BadInput(str(error)) from None


class PageChannel(Protocol):
    """One kind of data for pages. The hub enables it for the first page that shows it, and disables it for the last."""

    @property
    def period(self) -> float:
        """Minimum wall time [s] between two messages to a page."""
        ...

    @property
    def streams(self) -> bool:
        """Whether each message is sent, or only the newest."""
        ...

    @property
    def version(self) -> int:
        """Incremented by every change."""
        ...

    def set_enabled(self, enabled: bool) -> None:
        """Enable the channel for the first page, or disable it after the last."""
        ...

    def update(self, now: float) -> None:
        """Update from the new messages; ``now`` is wall time [s]. Called while the channel is enabled."""
        ...

    def delta(self, since: int) -> str | None:
        """Return the JSON message for a page that has the version ``since`` (-1 for none); None for no message."""
        ...


def as_json(kind: str, **content: object) -> str:
    """Encode a message to a page."""
    return msgspec.json.encode({"k": kind, **content}).decode()


MAGIC = 0x31454C45
"""``ELE1``."""

_HEAD, _SERIES = struct.Struct("<4I"), struct.Struct("<2I")


class Samples:
    """Times and values of one series since the last packet."""

    def __init__(self) -> None:
        self.times = array("d")
        self.values = array("d")

    def add(self, time: float, value: float) -> None:
        """Add a sample; ``time`` is simulation time [s]."""
        self.times.append(time)
        self.values.append(value)

    def __len__(self) -> int:
        return len(self.times)

    def encode(self) -> bytes:
        """Return the samples as sent: little-endian times, then values."""
        if sys.byteorder == "big":
            self.times.byteswap()
            self.values.byteswap()
        return self.times.tobytes() + self.values.tobytes()


def pack_samples(epoch: int, series: Iterable[tuple[int, int, bytes]]) -> bytes:
    """Encode a packet of series, each with its id, number of samples and encoded samples."""
    parts = [each for id_, count, body in series for each in (_SERIES.pack(id_, count), body)]
    return b"".join((_HEAD.pack(MAGIC, epoch & 0xFFFFFFFF, len(parts) // 2, 0), *parts))
