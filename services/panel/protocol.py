"""The protocol between the page and the panel: client messages, channels, and the binary packet of plot samples.

Little-endian: four uint32 (the mark, the epoch of simulation time, how many series, 0); then for each series two uint32
(its id, how many samples), its times [s of simulation time] and its values, float64 each. Everything lies at multiples
of 8 bytes, where a browser puts typed arrays over it.
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
"""Bytes of what a page sends; more ends the connection."""

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
    """Anything that a page says."""


class PlotSeries(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One field of one topic to plot; ``id`` is the page's own number for it."""

    id: Id
    topic: Name
    path: Name


class Subscribe(ClientMessageBase, frozen=True, kw_only=True):
    """All that the page wants to see from now on; ``fields`` are topics whose content it lists, ``scan`` is the
    namespace of the robot whose laser it draws."""

    channels: Annotated[tuple[ChannelName, ...], Meta(max_length=16)] = ()
    series: Annotated[tuple[PlotSeries, ...], Meta(max_length=MAX_SERIES)] = ()
    fields: Annotated[tuple[Name, ...], Meta(max_length=4)] = ()
    scan: Name = ""


class Drive(ClientMessageBase, frozen=True, kw_only=True):
    """The hand is on the stick: said again and again for as long as it is."""

    robot: Name
    v: Number = 0.0
    w: Number = 0.0


class Release(ClientMessageBase, frozen=True, kw_only=True):
    """The hand is off the stick."""


class ClientRequest(ClientMessageBase, frozen=True, kw_only=True):
    """What is answered, under the number ``id``."""

    id: Id


class Pause(ClientRequest, frozen=True, kw_only=True):
    """Stop simulation time."""


class Resume(ClientRequest, frozen=True, kw_only=True):
    """Let simulation time go on."""


class Step(ClientRequest, frozen=True, kw_only=True):
    """Run some physics steps while paused."""

    count: Annotated[int, Meta(ge=1, le=2000)] = 1


class Reset(ClientRequest, frozen=True, kw_only=True):
    """All models to where they were spawned; with ``time``, time to zero too."""

    time: bool = True


class Process(ClientRequest, frozen=True, kw_only=True):
    """An order to the supervisor."""

    verb: Literal["start", "stop", "restart"]
    name: Name


class Set(ClientRequest, frozen=True, kw_only=True):
    """Change parameters of a set, all or none; ``run`` for this run alone."""

    set: SetName
    values: Annotated[dict[str, Value], Meta(min_length=1, max_length=256)]
    run: bool = False


class Unset(ClientRequest, frozen=True, kw_only=True):
    """Take what was set of the named parameters back, of all when none is named."""

    set: SetName
    names: Annotated[tuple[Name, ...], Meta(max_length=256)] = ()


class Undo(ClientRequest, frozen=True, kw_only=True):
    """Take the newest change of a set back."""

    set: SetName


class History(ClientRequest, frozen=True, kw_only=True):
    """The newest changes of a set."""

    set: SetName
    limit: Annotated[int, Meta(ge=1, le=200)] = 30


class Goal(ClientRequest, frozen=True, kw_only=True):
    """Send a robot to a point of the world, m, m, rad."""

    robot: Name
    x: Annotated[float, Meta(ge=-1e4, le=1e4)]
    y: Annotated[float, Meta(ge=-1e4, le=1e4)]
    yaw: Annotated[float, Meta(ge=-100, le=100)] = 0.0


class Estop(ClientRequest, frozen=True, kw_only=True):
    """Stop a robot, all when ``robot`` is empty, until ``on=false`` resets it."""

    robot: Name = ""
    on: bool


ClientMessage = (
    Subscribe | Drive | Release | Pause | Resume | Step | Reset | Process | Set | Unset | Undo | History | Goal | Estop
)

_decoder: msgspec.json.Decoder[ClientMessage] = msgspec.json.Decoder(ClientMessage)


def decode_message(text: str) -> ClientMessage:
    """What a page said; raises BadInput with the field and the reason."""
    try:
        message = _decoder.decode(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeEncodeError) as error:
        raise BadInput(f"not understood: {error}") from None
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
    """One kind of news. The hub opens it when the first page wants it, and closes it after the last."""

    @property
    def period(self) -> float:
        """Wall time between two tellings at least [s]."""
        ...

    @property
    def streams(self) -> bool:
        """Whether each telling matters, or the newest alone."""
        ...

    @property
    def version(self) -> int:
        """Grows with every change."""
        ...

    def set_enabled(self, wanted: bool) -> None:
        """Somebody wants it, or nobody does."""
        ...

    def update(self, now: float) -> None:
        """Take in what has come; ``now`` is wall time [s]. Called while it is wanted."""
        ...

    def delta(self, since: int) -> str | None:
        """What a page that knows the version ``since`` (-1 for nothing) has to hear, as JSON."""
        ...


def as_json(kind: str, **content: object) -> str:
    """A message to a page."""
    return msgspec.json.encode({"k": kind, **content}).decode()


MAGIC = 0x31454C45
"""``ELE1``."""

_HEAD, _SERIES = struct.Struct("<4I"), struct.Struct("<2I")


class Samples:
    """Times and values of one series since the last frame."""

    def __init__(self) -> None:
        self.times = array("d")
        self.values = array("d")

    def add(self, time: float, value: float) -> None:
        """One sample."""
        self.times.append(time)
        self.values.append(value)

    def __len__(self) -> int:
        return len(self.times)

    def encode(self) -> bytes:
        """The samples as they travel."""
        if sys.byteorder == "big":
            self.times.byteswap()
            self.values.byteswap()
        return self.times.tobytes() + self.values.tobytes()


def pack_samples(epoch: int, series: Iterable[tuple[int, int, bytes]]) -> bytes:
    """A frame of series, each its id, its count of samples and its body."""
    parts = [each for id_, count, body in series for each in (_SERIES.pack(id_, count), body)]
    return b"".join((_HEAD.pack(MAGIC, epoch & 0xFFFFFFFF, len(parts) // 2, 0), *parts))
