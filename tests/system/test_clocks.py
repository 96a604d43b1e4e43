"""Commands to a real simulation stamped by a clock that is stepped, offset or wrong, and delayed commands."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator

import pytest

from messages.base import encode
from messages.elea import BaseStatus
from messages.geometry import Twist
from messages.topics import BASE_STATUS, CMD_VEL
from services.runtime.node import Node
from services.runtime.transport.wire import encoding, publisher_id
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, speed
from tests.harness.waiting import wait_until
from tests.system.two_robot_simulation import TwoRobotSimulation, two_robot_simulation

HOUR = 3600.0
PERIOD_S = 0.02
COMMAND = encode(Twist.planar(0.1, 0.0))
ENOUGH = 10
"""Number of obeyed commands after which the base counts as obeying again."""
AT_ONCE = 10
"""Number of commands held back at once: of more than 16, a link drops some on a busy machine."""


class Commander:
    """Commands tb3_0 to drive, at 50 Hz, stamped by a clock with the offset ``off`` [s]."""

    def __init__(self, node: Node, life: str) -> None:
        self.off, self._sent, self._due = 0.0, 0, 0.0
        self._id = publisher_id("/skewed", life, "tb3_0/cmd_vel")
        self._out = node.transport.advertise("tb3_0/cmd_vel", encoding(Twist.ROS_TYPE), CMD_VEL.quality)
        self._truth, self.status = (
            GroundTruthRecorder(node, "tb3_0"),
            MessageRecorder(node.subscribe(BASE_STATUS, "/tb3_0/base_status")),
        )
        self.status.wait_next()
        self._truth.wait_next()

    def __enter__(self) -> Commander:
        return self

    def __exit__(self, *exception: object) -> None:
        self._out.close()
        self.stand()

    @property
    def base(self) -> BaseStatus:
        """The latest base status."""
        return self.status.received()[-1]

    @property
    def speed(self) -> float:
        return speed(self._truth.received()[-1])

    def send(self, off: float | None = None, made: float | None = None) -> None:
        """Send one command, stamped as if sent at ``made`` [s since the epoch], by default now."""
        self._sent += 1
        stamp = (time.time() if made is None else made) + (self.off if off is None else off)
        self._out.put(COMMAND, attachment=struct.pack("<qqB16s", self._sent, round(stamp * 1e9), 16, self._id))

    def drive(self, probe: Callable[[], object], what: str) -> None:
        """Send at 50 Hz until a condition holds."""

        def step() -> object:
            if time.monotonic() >= self._due:
                self._due = time.monotonic() + PERIOD_S
                self.send()
            return probe()

        wait_until(step, WITHIN_S, what)

    def obeyed(self, what: str) -> None:
        """Drive until the robot obeys the commands sent from now on."""
        taken = self.base.commands
        self.drive(lambda: self.base.commands > taken + ENOUGH and self.speed > 0.09, f"a robot that drives: {what}")

    def stand(self) -> None:
        """Wait until the robot stands still without commands."""
        wait_until(lambda: abs(self.speed) < 1e-3, WITHIN_S, "a robot that stands")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoRobotSimulation]:
    with two_robot_simulation(tmp_path_factory.mktemp("clocks")) as made:
        yield made


def test_a_clock_that_is_set_locks_nobody_out(running: TwoRobotSimulation) -> None:
    with Commander(running.node, "1") as commander:
        commander.obeyed("all is well")
        for off in (-2.0, 0.0, HOUR, -HOUR, 365 * 24 * HOUR):
            commander.off = off
            commander.obeyed(f"the clock is {off} s off")


def test_a_first_stamp_an_hour_ahead_and_wrong_ones_later_lock_nobody_out(running: TwoRobotSimulation) -> None:
    with Commander(running.node, "2") as commander:
        commander.send(off=HOUR)
        commander.obeyed("after the first")
        for off in (HOUR, -HOUR):
            commander.send(off=off)
            commander.obeyed("after another")


def test_what_was_held_up_is_not_obeyed(running: TwoRobotSimulation) -> None:
    """Two seconds of commands, from a known and from an unknown publisher, arrive faster than they were made."""
    with Commander(running.node, "3") as known, Commander(running.node, "4") as unknown:
        known.obeyed("all is well")
        known.stand()
        for each in (known, unknown):
            told = each.status.wait_next()
            dropped, taken = told.stale_dropped, told.commands
            oldest = time.time() - 3.0
            for number in range(100):
                each.send(made=oldest + PERIOD_S * number)
                dropped += 1
                if (number + 1) % AT_ONCE == 0:
                    wait_until(lambda e=each, d=dropped: e.base.stale_dropped >= d, WITHIN_S, "all dropped")  # type: ignore[misc]
            assert each.base.commands == taken
            assert abs(each.speed) < 1e-3
