"""Showing the messages of a topic as they come."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from deploy.live.ends import absolute, topics
from deploy.live.fields import Path, check_path, parse_path, pick
from deploy.live.known import known_record, record_of, ros_type
from deploy.live.listener import Heard, Listener
from deploy.live.measure import INTERRUPTED
from deploy.live.output import note, say, say_json
from deploy.live.reader import Reader, info
from deploy.live.session import Session, session
from deploy.live.subject import await_subject, is_latched, type_of
from deploy.live.text import MOST, block, cells, flow, row, trimmed
from deploy.place import Place
from services.runtime.errors import EleaError
from services.runtime.graph import snapshot


@dataclass(frozen=True)
class Echo:
    """What is to be shown: the topic, its type if the sender does not tell it, parts of its messages, and how many."""

    topic: str
    type_name: str = ""
    fields: tuple[str, ...] = ()
    count: int = 0
    timeout: float | None = None
    wait: bool = False


@dataclass(frozen=True)
class Style:
    """How it is to be shown."""

    as_json: bool = False
    as_csv: bool = False
    no_header: bool = False
    no_arr: bool = False
    no_str: bool = False
    full_length: bool = False
    most: int | None = None
    flow_style: bool = False
    with_info: bool = False


def echo(place: Place, asked: Echo, style: Style) -> int:
    """Show messages until it is enough; the exit status. Raises EleaError when they do not come in time."""
    name, paths = absolute(asked.topic), [parse_path(each) for each in asked.fields]
    wanted = ros_type(record_of(asked.type_name).ROS_TYPE) if asked.type_name else ""
    deadline = None if asked.timeout is None else time.monotonic() + asked.timeout
    with session(place, "echo") as live:
        name, paths = _split(live, name, paths)
        ends = await_subject(live, name, asked.wait)
        expected, latched = wanted or type_of(ends), is_latched(ends)
        _check(expected, paths)
        printer = _Printer(style, paths)
        listener, reader = Listener(live.transport, name, latched), Reader(name, expected)
        live.reads(name, expected, "LATCHED" if latched else "SENSOR")
        left = None if deadline is None else max(0.0, deadline - time.monotonic())
        for _ in live.turns(listener.inlet, left):
            for heard in listener.take():
                printer.show(heard, reader.read(heard))
                if printer.shown == asked.count:
                    return 0
        if listener.lost:
            note(f"{listener.lost} messages were lost on the way here: they come faster than they can be shown")
        if live.stopping:
            return INTERRUPTED if asked.count else 0
    if printer.shown and not asked.count:
        return 0
    raise EleaError(
        f"{printer.shown} messages came on {name} within {asked.timeout:g} s: is somebody publishing there?"
    )


class _Printer:
    """Writes messages in the style that is asked for."""

    def __init__(self, style: Style, paths: list[Path]) -> None:
        self._style, self._paths = style, paths
        self._headed = style.no_header
        self.shown = 0
        whole = style.full_length or style.as_json or style.as_csv
        self._most = style.most or (None if whole else MOST)

    def show(self, heard: Heard, value: Any) -> None:
        """Write one message, with what came beside it if asked for."""
        if value is None:
            return
        style = self._style
        value = self._part(value)
        if not style.as_json or style.no_arr or style.no_str or style.most:
            value = trimmed(value, self._most, not style.no_arr, not style.no_str)
        if style.with_info:
            value = {"info": info(heard), "message": value}
        if style.as_json:
            say_json(value, lines=True)
        elif style.as_csv:
            self._row(value)
        else:
            say(flow(value) + "\n---\n" if style.flow_style else block(value) + "---\n", flush=True)
        self.shown += 1

    def _part(self, value: Any) -> Any:
        if not self._paths:
            return value
        if len(self._paths) == 1 and not self._style.as_csv:
            return pick(value, self._paths[0])
        return {".".join(path): pick(value, path) for path in self._paths}

    def _row(self, value: Any) -> None:
        columns = cells(value)
        if not self._headed:
            self._headed = True
            say(row([name for name, _ in columns]))
        say(row([text for _, text in columns]), flush=True)


def _split(live: Session, name: str, paths: list[Path]) -> tuple[str, list[Path]]:
    """The topic and the field in it, which rostopic's users write in one: ``/tb3_0/odom/pose/pose/position``."""
    known = topics(snapshot(live.transport)) if not paths else {}
    if paths or name in known:
        return name, paths
    above = [each for each in known if name.startswith(f"{each}/")]
    longest = max(above, key=len, default="")
    record = known_record(type_of(known[longest])) if longest else None
    if record is None:
        return name, paths
    path = parse_path(name.removeprefix(f"{longest}/"))
    check_path(record, path)
    return longest, [path]


def _check(type_name: str, paths: list[Path]) -> None:
    """Refuse fields that the type does not have before any message came."""
    record = known_record(type_name)
    for path in paths if record is not None else ():
        assert record is not None
        check_path(record, path)
