"""The tree of frames as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from deploy.live.frame_watch import FrameWatch
from deploy.live.output import note, say, say_json
from deploy.live.session import session
from deploy.place import Place
from services.runtime.errors import EleaError


def show_tree(place: Place, listen: float, as_json: bool) -> int:
    """Listen for a while [s of wall time], then show the tree; the exit status. Raises EleaError without any frame."""
    with session(place, "tf_tree") as live:
        watch = FrameWatch(live)
        for _ in live.turns(watch.moving.inlet, listen):
            watch.follow()
        watch.follow()
        names = watch.publishers()
        frames = watch.buffer.frames()
        if not frames:
            raise EleaError(
                f"no frames within {listen:g} s: nobody publishes on /tf or /tf_static; is a simulation running?"
            )
        rows = {each: _row(watch, each, names) for each in frames}
        faults = watch.faults(names) + _loops(rows)
        now = watch.clock.now
    if as_json:
        say_json({"time": None if now is None else now / 1e9, "frames": list(rows.values()), "faults": faults})
    else:
        say("".join(f"{line}\n" for line in drawn(rows)))
    for fault in faults if not as_json else ():
        note(fault)
    return 1 if faults else 0


def drawn(rows: dict[str, dict[str, Any]]) -> Iterator[str]:
    """The frames as a tree, each with what is known of it; those in a circle at the end."""
    below: dict[str | None, list[str]] = {}
    for name, row in rows.items():
        below.setdefault(row["parent"], []).append(name)
    shown: set[str] = set()
    for root in below.get(None, []):
        yield root
        shown.add(root)
        # A stack instead of recursion: a tree may be deeper than Python calls.
        stack = [(name, "", name == below[root][-1]) for name in reversed(below.get(root, []))]
        while stack:
            name, indent, last = stack.pop()
            shown.add(name)
            yield f"{indent}{'└── ' if last else '├── '}{name}  {_facts(rows[name])}"
            inner = f"{indent}{'    ' if last else '│   '}"
            stack += [(each, inner, each == below[name][-1]) for each in reversed(below.get(name, []))]
    for name in rows:
        if name not in shown:
            yield f"{name} in {rows[name]['parent']}  {_facts(rows[name])}, in a circle"


def _row(watch: FrameWatch, frame: str, names: dict[bytes, str]) -> dict[str, Any]:
    """A frame with what is told of it; the parent is None for a root."""
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


def _facts(row: dict[str, Any]) -> str:
    if row["static"]:
        facts = ["static"]
    else:
        rate, age = row["rate"], row["age"]
        facts = ["once" if rate is None else f"{rate:g} Hz"]
        facts += [] if age is None else [f"{age:g} s old"]
    return ", ".join([*facts, *row["publishers"]])


def _loops(rows: dict[str, dict[str, Any]]) -> list[str]:
    """Each circle of frames, once."""
    told, done = [], set()
    for name in rows:
        line, here = [name], name
        while (parent := rows[here]["parent"]) is not None and parent not in done:
            if parent in line:
                circle = line[line.index(parent) :]
                told.append(f"frames in a circle: {' in '.join([*circle, parent])}")
                break
            line.append(parent)
            here = parent
        done.update(line)
    return told


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
