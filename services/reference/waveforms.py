"""Waveforms of the reference over simulation time, in degrees."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path

from services.reference import ReferenceParameters
from services.runtime.errors import BadInput

MAX_FILE_BYTES = 64 << 20
"""Maximum file size [bytes]."""
MAX_ANGLE = 360_000.0
"""Maximum angle [deg]; a greater one must be a mistake."""


class ReferenceTable:
    """Linear interpolation between rows; constant before the first and after the last, unless repeated."""

    def __init__(self, times: list[float], angles: list[float]) -> None:
        self.times, self.angles = times, angles

    def at(self, time: float, repeat: bool = False) -> float:
        """Return the angle [deg] at ``time`` [s]; with ``repeat``, the last row is the first of the next round."""
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


def read_table(path: Path) -> ReferenceTable:
    """Read a table from a CSV file; raises BadInput with file and line.

    The two numbers of a row are separated by comma, semicolon or blanks; empty lines, comments (``#``) and a header row
    are skipped.
    """
    try:
        if path.exists() and not path.is_file():
            raise BadInput(f"the reference {path} cannot be read: it is not a file")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise BadInput(f"{path}: {path.stat().st_size} bytes, a reference has at most {MAX_FILE_BYTES}")
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
        if not abs(angle) <= MAX_ANGLE:
            raise BadInput(f"{where}: the angle {angle:g} deg must be within +-{MAX_ANGLE:g} deg")
        if times and time <= times[-1]:
            raise BadInput(f"{where}: the time {time:g} s is not after {times[-1]:g} s: times must increase")
        times.append(time)
        angles.append(angle)
    if not times:
        raise BadInput(f"{path}: there is no row of time [s] and angle [deg]")
    return ReferenceTable(times, angles)


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


TWO_PI = 2 * math.pi
BLEND_S = 0.5
"""Time [s] over which the amplitude changes linearly, so that the reference does not jump."""


class WaveformGenerator:
    """Generates the reference step by step; parameters may change at each step.

    The phase is accumulated, so that a change of frequency does not change it. Sine and chirp start at the rising phase
    with the current value (or at their extreme if it is beyond), so that switching to them causes no jump. Square and
    csv start at their beginning, ramp at the current reference.
    """

    def __init__(self, table: ReferenceTable | None = None) -> None:
        self._table = table
        self._waveform = ""
        self._value: float | None = None
        self._phase = self._elapsed = 0.0
        self._gain = self._target_gain = self._gain_rate = 0.0

    @property
    def phase(self) -> float:
        """Phase of sine, square or chirp [rad], in [0, 2 pi)."""
        return self._phase

    def step(self, p: ReferenceParameters, dt: float) -> float:
        """Return the reference [deg] after ``dt`` [s], not yet clipped to the joint's range.

        Waveforms that continue from the last reference use its clipped value; csv without a table keeps it.
        """
        begins = p.reference_type != self._waveform
        if begins:
            self._start(p)
        else:
            self._elapsed += dt
            self._update_gain(p.sin_ref_gain, dt)
        self._value = self._next(p, 0.0 if begins else dt)
        return self._value

    def _start(self, p: ReferenceParameters) -> None:
        self._waveform, self._elapsed, self._phase = p.reference_type, 0.0, 0.0
        self._gain = self._target_gain = p.sin_ref_gain
        if self._waveform in ("sine", "chirp") and self._value and self._gain:
            self._phase = math.asin(max(-1.0, min(1.0, self._value / self._gain))) % TWO_PI

    def _update_gain(self, target: float, dt: float) -> None:
        if target != self._target_gain:
            self._target_gain, self._gain_rate = target, abs(target - self._gain) / BLEND_S
        self._gain = _move_towards(self._gain, self._target_gain, self._gain_rate * dt)

    def _next(self, p: ReferenceParameters, dt: float) -> float:
        last = max(p.lower, min(p.upper, self._value or 0.0))
        match self._waveform:
            case "step":
                return p.ref_angle
            case "ramp":
                return _move_towards(last, p.ref_angle, p.ramp_rate * dt)
            case "sine":
                return self._gain * math.sin(self._advance_phase(p.sin_ref_f * dt))
            case "square":
                return math.copysign(self._gain, math.pi - self._advance_phase(p.sin_ref_f * dt))
            case "chirp":
                # The frequency is linear in time, so the one in the middle of the step is its mean.
                share = min(1.0, max(0.0, self._elapsed - dt / 2) / p.chirp_time)
                return self._gain * math.sin(
                    self._advance_phase((p.chirp_from + share * (p.chirp_to - p.chirp_from)) * dt)
                )
            case _:
                return last if self._table is None else self._table.at(self._elapsed, p.csv_repeat)

    def _advance_phase(self, turns: float) -> float:
        self._phase = (self._phase + TWO_PI * turns) % TWO_PI
        return self._phase


def _move_towards(value: float, target: float, most: float) -> float:
    return target if abs(target - value) <= most else value + math.copysign(most, target - value)
