"""What a page may say: typed, bounded, and refused with a reason when it is anything else."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from messages.names import BadName
from messages.names import key as absolute
from messages.parameters import SetName, Value
from services.panel.fields import parse
from services.runtime.errors import BadInput

LARGEST = 1 << 16
"""Bytes of what a page sends; more ends the connection."""

MOST_SERIES = 32

Name = Annotated[str, Meta(max_length=255)]
Number = Annotated[float, Meta(ge=-1e6, le=1e6)]
Id = Annotated[int, Meta(ge=0, le=2**31)]
ChannelName = Literal["clock", "fleet", "graph", "rates", "log", "poses", "robots", "sets", "values"]


class Word(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="k", tag=str.lower):
    """Anything that a page says."""


class Wish(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One field of one topic to plot; ``id`` is the page's own number for it."""

    id: Id
    topic: Name
    path: Name


class Want(Word, frozen=True, kw_only=True):
    """All that the page wants to see from now on; ``fields`` are topics whose content it lists."""

    channels: Annotated[tuple[ChannelName, ...], Meta(max_length=16)] = ()
    series: Annotated[tuple[Wish, ...], Meta(max_length=MOST_SERIES)] = ()
    fields: Annotated[tuple[Name, ...], Meta(max_length=4)] = ()


class Drive(Word, frozen=True, kw_only=True):
    """The hand is on the stick: said again and again for as long as it is."""

    robot: Name
    v: Number = 0.0
    w: Number = 0.0


class Release(Word, frozen=True, kw_only=True):
    """The hand is off the stick."""


class Ask(Word, frozen=True, kw_only=True):
    """What is answered, under the number ``id``."""

    id: Id


class Pause(Ask, frozen=True, kw_only=True):
    """Stop simulation time."""


class Resume(Ask, frozen=True, kw_only=True):
    """Let simulation time go on."""


class Step(Ask, frozen=True, kw_only=True):
    """Run some physics steps while paused."""

    count: Annotated[int, Meta(ge=1, le=2000)] = 1


class Reset(Ask, frozen=True, kw_only=True):
    """All models to where they were spawned; with ``time``, time to zero too."""

    time: bool = True


class Process(Ask, frozen=True, kw_only=True):
    """An order to the supervisor."""

    verb: Literal["start", "stop", "restart"]
    name: Name


class Set(Ask, frozen=True, kw_only=True):
    """Change parameters of a set, all or none; ``run`` for this run alone."""

    set: SetName
    values: Annotated[dict[str, Value], Meta(min_length=1, max_length=256)]
    run: bool = False


class Forget(Ask, frozen=True, kw_only=True):
    """Take what was set of the named parameters back, of all when none is named."""

    set: SetName
    names: Annotated[tuple[Name, ...], Meta(max_length=256)] = ()


class Undo(Ask, frozen=True, kw_only=True):
    """Take the newest change of a set back."""

    set: SetName


class History(Ask, frozen=True, kw_only=True):
    """The newest changes of a set."""

    set: SetName
    limit: Annotated[int, Meta(ge=1, le=200)] = 30


class Goal(Ask, frozen=True, kw_only=True):
    """Send a robot to a point of the world, m, m, rad."""

    robot: Name
    x: Annotated[float, Meta(ge=-1e4, le=1e4)]
    y: Annotated[float, Meta(ge=-1e4, le=1e4)]
    yaw: Annotated[float, Meta(ge=-100, le=100)] = 0.0


class Estop(Ask, frozen=True, kw_only=True):
    """Stop a robot, all when ``robot`` is empty, until ``on=false`` resets it."""

    robot: Name = ""
    on: bool


Said = Want | Drive | Release | Pause | Resume | Step | Reset | Process | Set | Forget | Undo | History | Goal | Estop

_decoder: msgspec.json.Decoder[Said] = msgspec.json.Decoder(Said)


def understand(text: str) -> Said:
    """What a page said; raises BadInput with the field and the reason."""
    try:
        said = _decoder.decode(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeEncodeError) as error:
        raise BadInput(f"not understood: {error}") from None
    match said:
        case Want():
            for wish in said.series:
                _check(wish.topic)
                parse(wish.path)
            for topic in said.fields:
                _check(topic)
        case Drive(robot=robot) | Goal(robot=robot):
            _check(robot)
        case Estop(robot=robot) if robot:
            _check(robot)
        case Set(set=name) | Forget(set=name) | Undo(set=name) | History(set=name):
            _check(name)
    return said


def _check(name: str) -> None:
    try:
        absolute(name)
    except BadName as error:
        raise BadInput(str(error)) from None
