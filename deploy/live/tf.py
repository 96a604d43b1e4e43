"""The network's frames: their tree, and the transform between two of them."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from deploy import INTERRUPTED
from deploy.live.connect import cli_node, spin
from deploy.live.output import write_json, write_note, write_text
from deploy.live.subscribers import ClockSubscriber
from messages.tf import TFMessage
from messages.topics import TF, TF_STATIC, Topic
from services.runtime.errors import EleaError, NoTransform
from services.runtime.graph import Entity, snapshot
from services.runtime.light_node import LightNode
from services.runtime.network_address import NetworkAddress
from services.runtime.subscriber import Subscriber
from services.runtime.tf.buffer import LookupResult, TransformBuffer
from services.runtime.tf.listener import add_moving, add_static
from services.runtime.transport.wire import NODE_BYTES, SampleInfo, member_id

RATE_WINDOW = 256
"""Number of a frame's last stamps from which its rate is computed."""
CLOCK_S = 2.0
"""Wall time [s] to wait for the first clock before a moving frame is shown without its age."""


class TfMonitor:
    """Follows /tf, /tf_static and the clock. A reset clears the moving frames."""

    def __init__(self, live: LightNode) -> None:
        self.buffer, self.clock = TransformBuffer(), ClockSubscriber(live.transport)
        self._live = live
        self.dynamic, self._static = self._subscribe(TF), self._subscribe(TF_STATIC)
        self.stamps: dict[str, deque[int]] = {}
        self._epoch = 0

    def update(self) -> None:
        """Read new messages."""
        before = self.clock.now
        self.clock.update()
        now = self.clock.now
        if self.clock.epoch != self._epoch or (before is not None and now is not None and now < before):
            self._epoch = self.clock.epoch
            self.buffer.clear()
            self.stamps.clear()
        self._static.update()
        self.dynamic.update()
        self.dynamic.messages = [each for each in self.dynamic.messages if not self._is_from_before_reset(*each)]
        add_moving(self.buffer, self.dynamic)
        add_static(self.buffer, self._static)
        for message, _ in self.dynamic.messages:
            for each in message.transforms:
                seen = self.stamps.setdefault(each.child_frame_id.removeprefix("/"), deque(maxlen=RATE_WINDOW))
                seen.append(each.header.stamp.ns)

    def age(self, stamp: int) -> float | None:
        """Return the age of a stamp [s of simulation time]; None without a clock."""
        return None if self.clock.now is None else max(0.0, (self.clock.now - stamp) / 1e9)

    def rate(self, frame: str) -> float | None:
        """Return the rate of a moving frame [Hz of simulation time]; None until two stamps are known."""
        stamps = sorted(set(self.stamps.get(frame, ())))
        return (len(stamps) - 1) * 1e9 / (stamps[-1] - stamps[0]) if len(stamps) > 1 else None

    def publishers(self) -> dict[bytes, str]:
        """Return the nodes that currently publish frames, by their ids in the buffer."""
        ends: list[Entity] = snapshot(self._live.transport)
        return {
            member_id(each.node, each.session)[:NODE_BYTES]: each.node
            for each in ends
            if each.kind == "pub" and each.name in (TF.name, TF_STATIC.name)
        }

    def faults(self, names: dict[bytes, str]) -> list[str]:
        """Return problems of the tree, and rejected transforms; ``names`` are those of the publishers."""
        problems = []
        for frame, text in self.buffer.conflicts().items():
            publishers = [
                names.get(each, "a foreign sender" if not each else "?") for each in self.buffer.publishers(frame)
            ]
            problems.append(f"{text}: published by {', '.join(publishers)}")
        if self.buffer.refused:
            problems.append(f"{self.buffer.refused} transforms refused, the last one: {self.buffer.reason}")
        for source in (self.dynamic, self._static):
            if source.refused:
                problems.append(f"{source.name}: {source.refused} messages refused, the last one: {source.reason}")
        return problems

    def _is_from_before_reset(self, message: TFMessage, origin: SampleInfo | None) -> bool:
        """Return whether transforms that arrived after the first clock of this epoch are of the epoch before.

        The first transforms of an epoch are sent before its first clock, too, but their stamps are not ahead of it.
        """
        now = self.clock.now
        if origin is None or now is None or origin.source_ns >= self.clock.since:
            return False
        return any(each.header.stamp.ns > now for each in message.transforms)

    def _subscribe(self, topic: Topic[TFMessage]) -> Subscriber[Any]:
        made = Subscriber(topic, topic.name, topic.name[1:], self._live.transport)
        self._live.declare_subscription(topic.name, topic.record.ROS_TYPE, topic.quality.name)
        return made


def show_tree(address: NetworkAddress, listen: float, as_json: bool) -> int:
    """Listen for a while [s of wall time], then show the tree; return the exit status. Raises EleaError without any
    frame.
    """
    with cli_node(address, "tf_tree") as live:
        watch = TfMonitor(live)
        for _ in spin(live, watch.dynamic.raw, listen):
            watch.update()
        watch.update()
        names = watch.publishers()
        frames = watch.buffer.frames()
        if not frames:
            raise EleaError(f"no frames on /tf or /tf_static within {listen:g} s: is a simulation running?")
        rows = {each: _frame_row(watch, each, names) for each in frames}
        faults = watch.faults(names) + _find_cycles(rows)
        now = watch.clock.now
    if as_json:
        write_json({"time": None if now is None else now / 1e9, "frames": list(rows.values()), "faults": faults})
    else:
        write_text("".join(f"{line}\n" for line in format_tree(rows)))
    for fault in faults if not as_json else ():
        write_note(fault)
    return 1 if faults else 0


def format_tree(rows: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Format the frames as a tree, each with its rate, age and publisher; frames in a loop come last."""
    below: dict[str | None, list[str]] = {}
    for name, row in rows.items():
        below.setdefault(row["parent"], []).append(name)
    shown: set[str] = set()
    for root in below.get(None, []):
        yield root
        shown.add(root)
        # A stack instead of recursion: a tree may be deeper than Python's recursion limit.
        stack = [(name, "", name == below[root][-1]) for name in reversed(below.get(root, []))]
        while stack:
            name, indent, last = stack.pop()
            shown.add(name)
            yield f"{indent}{'└── ' if last else '├── '}{name}  {_format_frame(rows[name])}"
            inner = f"{indent}{'    ' if last else '│   '}"
            stack += [(each, inner, each == below[name][-1]) for each in reversed(below.get(name, []))]
    for name in rows:
        if name not in shown:
            yield f"{name} in {rows[name]['parent']}  {_format_frame(rows[name])}, in a loop"


def _frame_row(watch: TfMonitor, frame: str, names: dict[bytes, str]) -> dict[str, Any]:
    """Return a frame's data; the parent is None for a root."""
    span = watch.buffer.span(frame)
    return {
        "frame": frame,
        "parent": watch.buffer.parent(frame),
        "static": span is None and watch.buffer.parent(frame) is not None,
        "publishers": sorted(
            names.get(each, "(gone)") if each else "(foreign)" for each in watch.buffer.publishers(frame)
        ),
        "rate": _rounded(watch.rate(frame)),
        "stamp": None if span is None else span[1] / 1e9,
        "age": None if span is None else _rounded(watch.age(span[1])),
    }


def _format_frame(row: dict[str, Any]) -> str:
    if row["static"]:
        facts = ["static"]
    else:
        rate, age = row["rate"], row["age"]
        facts = ["once" if rate is None else f"{rate:g} Hz"]
        facts += [] if age is None else [f"{age:g} s old"]
    return ", ".join([*facts, *row["publishers"]])


def _find_cycles(rows: dict[str, dict[str, Any]]) -> list[str]:
    """Return each cycle of frames, once."""
    problems, done = [], set()
    for name in rows:
        line, here = [name], name
        while (parent := rows[here]["parent"]) is not None and parent not in done:
            if parent in line:
                circle = line[line.index(parent) :]
                problems.append(f"frames in a loop: {' in '.join([*circle, parent])}")
                break
            line.append(parent)
            here = parent
        done.update(line)
    return problems


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


@dataclass(frozen=True)
class TfEchoOptions:
    """Rate [Hz of simulation time], number (0: until Ctrl-C), time to wait for the frames [s of wall time], and output
    format.
    """

    rate: float
    count: int
    timeout: float
    as_json: bool


def echo_transform(address: NetworkAddress, source: str, target: str, options: TfEchoOptions) -> int:
    """Show the pose of ``target`` in ``source`` until ``count`` or a signal; returns the exit status.

    Raises NoTransform when it is not available within ``timeout`` seconds.
    """
    period, shown, due = round(1e9 / options.rate), 0, 0
    with cli_node(address, "tf_echo") as live:
        watch = TfMonitor(live)
        began = time.monotonic()
        deadline = began + options.timeout
        last_error = ""
        for _ in spin(live, watch.clock.raw):
            watch.update()
            # Without a clock, e.g. with only static frames, the wall clock is used.
            now = time.monotonic_ns() if watch.clock.now is None else watch.clock.now
            if shown and due - period <= now < due:
                continue
            try:
                found = watch.buffer.lookup(source, target)
            except NoTransform as error:
                if time.monotonic() > deadline:
                    raise
                if shown and str(error) != last_error:
                    last_error = str(error)
                    write_note(f"waiting: {last_error}")
                continue
            if found.time is not None and watch.clock.now is None and time.monotonic() < began + CLOCK_S:
                continue  # the first transforms may arrive before the first clock
            deadline = time.monotonic() + options.timeout
            _show_transform(source, target, found, watch, options.as_json)
            shown += 1
            if shown == options.count:
                return 0
            due = now - now % period + period
    return INTERRUPTED if options.count else 0


def _show_transform(source: str, target: str, found: LookupResult, watch: TfMonitor, as_json: bool) -> None:
    row = transform_facts(source, target, found, watch)
    if as_json:
        write_json(row, lines=True)
        return
    when = "fixed, at any time" if found.time is None else f"at {found.time / 1e9:.3f} s"
    age = "" if row["age"] is None or row["age"] < 0.5 else f", {row['age']:.3f} s old"
    lines = [
        f"{target} in {source}, {when}{age}",
        f"- translation [m]: {_format_vector(found.transform.position)}",
        f"- quaternion (x, y, z, w): {_format_vector(found.transform.orientation)}",
        f"- rpy [rad]: {_format_vector(row['rpy'])}",
        f"- rpy [deg]: {_format_vector(row['rpy_degrees'], 2)}",
    ]
    write_text("\n".join(lines) + "\n", flush=True)


def transform_facts(source: str, target: str, found: LookupResult, watch: TfMonitor) -> dict[str, Any]:
    """Return an answer for JSON; times and ages in s of simulation time, None for static frames."""
    rpy = found.transform.rpy
    age = None if found.time is None else watch.age(found.time)
    return {
        "source": source,
        "target": target,
        "time": None if found.time is None else found.time / 1e9,
        "age": None if age is None else round(age, 6),
        "translation": dict(zip("xyz", found.transform.position, strict=True)),
        "quaternion": dict(zip("xyzw", found.transform.orientation, strict=True)),
        "rpy": list(rpy),
        "rpy_degrees": [math.degrees(each) for each in rpy],
    }


def _format_vector(values: Any, digits: int = 4) -> str:
    """Format as ``[0.1000, -0.2000, 0.0000]``, without a sign on zero."""
    return f"[{', '.join(f'{round(each, digits) + 0.0:.{digits}f}' for each in values)}]"
