"""Records robots as a member of their lockstep, and so every sample, however busy the machine is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from messages.base import Message, decoder, encode
from messages.elea import BaseStatus
from messages.nav import Odometry
from messages.topics import BASE_STATUS, GROUND_TRUTH
from services.runtime import Parameters, Service, main
from services.runtime.context import Context
from tests.harness.processes import Network, parameter_options
from tests.harness.waiting import wait_until

NODE = "/lockstep_recorder"
"""Its name in the simulation's list of members."""
WITHIN_S = 60.0
"""Wall time limit for what takes a few seconds on an idle machine."""
TICK_REACHED = "has taken the tick of which it is to tell"
"""What it prints at the tick at ``tell``."""


class LockstepRecorderParameters(Parameters):
    """Robots to record, time [s] of the tick to report, time [s] of the end, and the output file."""

    robots: tuple[str, ...] = ()
    tell: float = 0.0
    until: float = 1.0
    output: str = "seen"


class RobotRecording(Message, frozen=True, kw_only=True):
    """Ground truth and base statuses by robot, oldest first."""

    truth: dict[str, list[Odometry]]
    status: dict[str, list[BaseStatus]]


_read_recording = decoder(RobotRecording)


class LockstepRecorder:
    """Runs the recorder as a process."""

    def __init__(
        self, network: Network, folder: Path, robots: Sequence[str], seconds: float, tell: float = 0.0
    ) -> None:
        self._output = folder / "seen"
        given = {"robots": list(robots), "tell": tell, "until": seconds, "output": str(self._output)}
        self._process = network.run(Path(__file__), "--lockstep", *parameter_options(given))

    def wait_tick(self) -> None:
        """Wait until it has reached the tick at ``tell``."""
        wait_until(lambda: TICK_REACHED in self._process.text, WITHIN_S, "the recorder's tick")

    def recording(self) -> RobotRecording:
        """Wait for its end and return the recording."""
        wait_until(self._output.exists, WITHIN_S, "what there is to see")
        return _read_recording(self._output.read_bytes())


def run(ctx: Context[LockstepRecorderParameters]) -> None:
    p = ctx.params
    truth = {name: ctx.stream(GROUND_TRUTH.of(name)) for name in p.robots}
    bases = {name: ctx.stream(BASE_STATUS.of(name)) for name in p.robots}
    samples: dict[str, list[Odometry]] = {name: [] for name in p.robots}
    states: dict[str, list[BaseStatus]] = {name: [] for name in p.robots}
    for tick in ctx.ticks():
        for name in p.robots:
            samples[name] += truth[name].drain()
            states[name] += bases[name].drain()
        if tick.time == round(p.tell * 1e9):
            print(TICK_REACHED, flush=True)
        if tick.time >= round(p.until * 1e9):
            break
    unfinished = Path(p.output).with_suffix(".part")
    unfinished.write_bytes(encode(RobotRecording(truth=samples, status=states)))
    unfinished.rename(p.output)


if __name__ == "__main__":
    main(
        Service(
            name="lockstep_recorder",
            about="Sees what robots do.",
            run=run,
            rate=50,
            parameters=LockstepRecorderParameters,
        )
    )
