"""The forms of the reference, over simulation time: parameters and time steps in, degrees out."""

from __future__ import annotations

import math

from services.reference import ReferenceParameters
from services.reference.table import Table

TURN = 2 * math.pi
BLEND_S = 0.5
"""Time that an amplitude takes to become another, evenly: the reference has no jump."""


class Forms:
    """The reference as it goes on; parameters may change at every step.

    Phase is summed up over time, so a change of frequency is none of the phase. Sine and chirp begin at the phase, on
    the way up, at which they have the present value (at their extreme, if it lies beyond): going over to them is no
    jump. Square and csv begin at their beginning, ramp where the reference is.
    """

    def __init__(self, table: Table | None = None) -> None:
        self._table = table
        self._form = ""
        self._value: float | None = None
        self._phase = self._elapsed = 0.0
        self._gain = self._target = self._pace = 0.0

    @property
    def phase(self) -> float:
        """Of sine, square or chirp, rad, between 0 and 2 pi."""
        return self._phase

    def step(self, p: ReferenceParameters, dt: float) -> float:
        """The reference [deg], ``dt`` [s] after the last; not yet bounded. csv without a table keeps the last.

        What goes on from the last, goes on from what could be told of it, within the joint's range.
        """
        begins = p.reference_type != self._form
        if begins:
            self._begin(p)
        else:
            self._elapsed += dt
            self._amplitude(p.sin_ref_gain, dt)
        self._value = self._next(p, 0.0 if begins else dt)
        return self._value

    def _begin(self, p: ReferenceParameters) -> None:
        self._form, self._elapsed, self._phase = p.reference_type, 0.0, 0.0
        self._gain = self._target = p.sin_ref_gain
        if self._form in ("sine", "chirp") and self._value and self._gain:
            self._phase = math.asin(max(-1.0, min(1.0, self._value / self._gain))) % TURN

    def _amplitude(self, wanted: float, dt: float) -> None:
        if wanted != self._target:
            self._target, self._pace = wanted, abs(wanted - self._gain) / BLEND_S
        self._gain = _towards(self._gain, self._target, self._pace * dt)

    def _next(self, p: ReferenceParameters, dt: float) -> float:
        last = max(p.lower, min(p.upper, self._value or 0.0))
        match self._form:
            case "step":
                return p.ref_angle
            case "ramp":
                return _towards(last, p.ref_angle, p.ramp_rate * dt)
            case "sine":
                return self._gain * math.sin(self._turn(p.sin_ref_f * dt))
            case "square":
                return math.copysign(self._gain, math.pi - self._turn(p.sin_ref_f * dt))
            case "chirp":
                # Straight in time, so the frequency in the middle of the step is its mean.
                share = min(1.0, max(0.0, self._elapsed - dt / 2) / p.chirp_time)
                return self._gain * math.sin(self._turn((p.chirp_from + share * (p.chirp_to - p.chirp_from)) * dt))
            case _:
                return last if self._table is None else self._table.at(self._elapsed, p.csv_repeat)

    def _turn(self, turns: float) -> float:
        self._phase = (self._phase + TURN * turns) % TURN
        return self._phase


def _towards(value: float, target: float, most: float) -> float:
    return target if abs(target - value) <= most else value + math.copysign(most, target - value)
