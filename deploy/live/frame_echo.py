"""Where one frame lies in another, shown again and again."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

from deploy.live.frame_watch import FrameWatch
from deploy.live.output import note, say, say_json
from deploy.live.session import session
from deploy.place import Place
from services.runtime.errors import NoTransform
from services.runtime.frames.buffer import Found

INTERRUPTED = 130
"""Exit status of what was asked for a number of answers and interrupted before."""


@dataclass(frozen=True)
class Terms:
    """How often [per second of simulation time], how many (0: until Ctrl-C), how long to wait for the frames [s of
    wall time], and how to show it.
    """

    rate: float
    count: int
    timeout: float
    as_json: bool


def echo_frames(place: Place, source: str, target: str, terms: Terms) -> int:
    """Show where ``target`` lies in ``source`` until it is enough; the exit status.

    Raises NoTransform when it cannot be told for ``timeout`` seconds.
    """
    period, shown, due = round(1e9 / terms.rate), 0, 0
    with session(place, "tf_echo") as live:
        watch = FrameWatch(live)
        patience = time.monotonic() + terms.timeout
        said = ""
        for _ in live.turns(watch.clock.inlet):
            watch.follow()
            # Without a clock, as where only fixed frames are told, the wall's serves.
            now = time.monotonic_ns() if watch.clock.now is None else watch.clock.now
            if shown and due - period <= now < due:
                continue
            try:
                found = watch.buffer.lookup(source, target)
            except NoTransform as error:
                if time.monotonic() > patience:
                    raise
                if shown and str(error) != said:
                    said = str(error)
                    note(f"waiting: {said}")
                continue
            patience = time.monotonic() + terms.timeout
            _show(source, target, found, watch, terms.as_json)
            shown += 1
            if shown == terms.count:
                return 0
            due = now - now % period + period
    return INTERRUPTED if terms.count else 0


def _show(source: str, target: str, found: Found, watch: FrameWatch, as_json: bool) -> None:
    row = facts(source, target, found, watch)
    if as_json:
        say_json(row, lines=True)
        return
    when = "fixed, at any time" if found.time is None else f"at {found.time / 1e9:.3f} s"
    age = "" if row["age"] is None or row["age"] < 0.5 else f", {row['age']:.3f} s old"
    lines = [
        f"{target} in {source}, {when}{age}",
        f"- translation [m]: {_numbers(found.rigid.place)}",
        f"- quaternion (x, y, z, w): {_numbers(found.rigid.turn)}",
        f"- rpy [rad]: {_numbers(row['rpy'])}",
        f"- rpy [deg]: {_numbers(row['rpy_degrees'], 2)}",
    ]
    say("\n".join(lines) + "\n", flush=True)


def facts(source: str, target: str, found: Found, watch: FrameWatch) -> dict[str, Any]:
    """An answer as it goes out as JSON; times and ages in s of simulation time, None for what is fixed."""
    rpy = found.rigid.rpy
    age = None if found.time is None else watch.age(found.time)
    return {
        "source": source,
        "target": target,
        "time": None if found.time is None else found.time / 1e9,
        "age": None if age is None else round(age, 6),
        "translation": dict(zip("xyz", found.rigid.place, strict=True)),
        "quaternion": dict(zip("xyzw", found.rigid.turn, strict=True)),
        "rpy": list(rpy),
        "rpy_degrees": [math.degrees(each) for each in rpy],
    }


def _numbers(values: Any, digits: int = 4) -> str:
    """``[0.1000, -0.2000, 0.0000]``, without a sign on zero."""
    return f"[{', '.join(f'{round(each, digits) + 0.0:.{digits}f}' for each in values)}]"
