"""Stops of a base after its commands ended: time and distance, compared with theory."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from messages.elea import BaseStatus
from models.dynamics import predict_stop
from services.grader import BrakingSpec

MAX_SAMPLES = 4096
"""Maximum number of samples since the last command: 80 s at 50 Hz, longer than any time-out of a base."""
REST_SPEED = 1e-3
"""True speed [m/s] below which a base rests; physics jitter stays below it."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Ground truth at ``stamp`` [ns]: distance travelled [m] and speed [m/s]."""

    stamp: int
    length: float
    speed: float


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop, from the last command at a true ``speed`` [m/s] to rest: time [s], distance [m], and theory, if known."""

    speed: float | None = None
    time: float | None = None
    distance: float | None = None
    theory_time: float | None = None
    theory_distance: float | None = None


class StopMetrics:
    """Measures each stop by ground truth. The status of the base is up to 0.2 s late, so samples are buffered.

    ``braking`` is how the base currently brakes, if known.
    """

    def __init__(self, braking: BrakingSpec | None = None) -> None:
        self.count = 0
        self.longest = Stop()
        self.braking = braking
        self._samples: deque[Sample] = deque(maxlen=MAX_SAMPLES)
        self._timed_out = 0
        self._last_command: int | None = None

    def add_status(self, status: BaseStatus) -> None:
        """Process the base's count of command time-outs, and the time of its last command."""
        last = status.last_command.ns
        if status.commands_timed_out > self._timed_out and status.timed_out:
            self._last_command = last
        elif last != self._last_command:
            self._last_command = None
        self._timed_out = status.commands_timed_out
        while len(self._samples) > 1 and self._samples[1].stamp <= last:
            self._samples.popleft()
        self._check_stop()

    def add_sample(self, stamp: int, length: float, speed: float) -> None:
        """Add the true distance travelled [m] and speed [m/s] at ``stamp`` [ns]."""
        self._samples.append(Sample(stamp, length, speed))
        if speed < REST_SPEED:
            self._check_stop()

    def _check_stop(self) -> None:
        """Record the stop once the samples cover it, from the last command to rest."""
        if self._last_command is None or not self._samples:
            return
        begin = self._samples[0]
        end = next((i for i, each in enumerate(self._samples) if each.speed < REST_SPEED), None)
        if end is None:
            return
        since, self._last_command = self._last_command, None
        if end == 0 or begin.stamp > since:
            return  # it stood already, or the command is older than all samples
        samples = list(self._samples)[: end + 1]
        distance = samples[-1].length - _length_at(begin, samples[1], since)
        self.count += 1
        if self.longest.distance is None or distance > self.longest.distance:
            base = self.braking
            # Without a time-out, the network determines when the base detects the loss of its publisher.
            timed = base is not None and base.timeout > 0
            theory = predict_stop(begin.speed, base.timeout, base.brake) if base and timed else (None, None)
            self.longest = Stop(begin.speed, _rest_time(samples) - since / 1e9, distance, *theory)


def _length_at(before: Sample, after: Sample, stamp: int) -> float:
    """Return the distance travelled [m] at ``stamp`` [ns], interpolated linearly, also across lost samples."""
    share = (stamp - before.stamp) / (after.stamp - before.stamp)
    return before.length + share * (after.length - before.length)


def _rest_time(samples: list[Sample]) -> float:
    """Return the time of rest [s], between the last two samples, extrapolated from the deceleration before."""
    rest = samples[-1].stamp / 1e9
    if len(samples) < 3:
        return rest
    before, last = samples[-3], samples[-2]
    if before.speed <= last.speed:
        return rest
    brake = (before.speed - last.speed) / (last.stamp - before.stamp)
    return min(rest, (last.stamp + last.speed / brake) / 1e9)
