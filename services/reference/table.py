"""A reference from a CSV file: rows of time [s] and angle [deg]."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path

from services.runtime.errors import BadInput

LARGEST = 64 << 20
"""Bytes of a file."""
FURTHEST = 360_000.0
"""deg; an angle beyond is a slip of the pen."""


class Table:
    """Straight lines between the rows; before the first its angle, after the last its angle or from the start again."""

    def __init__(self, times: list[float], angles: list[float]) -> None:
        self.times, self.angles = times, angles

    def at(self, time: float, repeat: bool = False) -> float:
        """The angle [deg] at ``time`` [s]; with ``repeat`` the last row is the first of the next round."""
        end = self.times[-1]
        if repeat and time >= end > 0:
            time = math.fmod(time, end)
        right = bisect_right(self.times, time)
        if right == 0:
            return self.angles[0]
        if right == len(self.times):
            return self.angles[-1]
        t0, t1 = self.times[right - 1 : right + 1]
        a0, a1 = self.angles[right - 1 : right + 1]
        return a0 + (a1 - a0) * (time - t0) / (t1 - t0)


def read_table(path: Path) -> Table:
    """The rows of a file; raises BadInput with file and line.

    Comma, semicolon or blanks between the two numbers; empty lines, lines from ``#`` on and a heading are passed over.
    """
    try:
        if path.exists() and not path.is_file():
            raise BadInput(f"the reference {path} cannot be read: it is no file")
        if path.stat().st_size > LARGEST:
            raise BadInput(f"{path}: {path.stat().st_size} bytes, a reference has at most {LARGEST}")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"the reference {path} cannot be read: {error}") from None
    times: list[float] = []
    angles: list[float] = []
    for number, cells in _rows(text):
        where = f"{path}:{number}"
        if len(cells) != 2:
            raise BadInput(f"{where}: {len(cells)} values, a row has two: time [s] and angle [deg]")
        try:
            time, angle = (float(cell) for cell in cells)
        except ValueError:
            if not times and not any(map(_is_number, cells)):
                continue
            raise BadInput(f"{where}: {' '.join(cells)[:80]!r} is not two numbers") from None
        if not (0 <= time < math.inf):
            raise BadInput(f"{where}: the time {time:g} s must be finite and at least 0")
        if not abs(angle) <= FURTHEST:
            raise BadInput(f"{where}: the angle {angle:g} deg must lie within {FURTHEST:g} deg of 0")
        if times and time <= times[-1]:
            raise BadInput(f"{where}: the time {time:g} s does not follow {times[-1]:g} s: times must grow")
        times.append(time)
        angles.append(angle)
    if not times:
        raise BadInput(f"{path}: there is no row of time [s] and angle [deg]")
    return Table(times, angles)


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.partition("#")[0].strip()
        if bare:
            separator = next((each for each in (",", ";") if each in bare), None)
            yield number, [cell.strip() for cell in bare.split(separator)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
