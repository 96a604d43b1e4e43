"""The frames of ``tf echo`` and ``tf tree`` on an in-memory bus."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from deploy.live import tf
from deploy.live.tf import TfEchoOptions, TfMonitor, echo_transform
from messages.geometry import TransformStamped
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import TF
from services.runtime.light_node import LightNode
from services.runtime.network_address import NetworkAddress
from services.runtime.publisher import Publisher
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import ManualClock

SECOND = 1_000_000_000


def test_after_a_reset_transforms_from_before_it_are_left_out() -> None:
    bus = MemoryBus()
    monitor, clock = TfMonitor(LightNode(MemoryTransport(bus), "tf")), ManualClock(bus)
    publisher = Publisher(TF, TF.name, TF.name[1:], "/base", MemoryTransport(bus))

    def send(time: int) -> None:
        header = Header(stamp=Time.of(time), frame_id="odom")
        publisher.publish(TFMessage(transforms=(TransformStamped(header=header, child_frame_id="base"),)))

    def newest() -> int | None:
        monitor.update()
        return monitor.buffer.lookup("odom", "base").time

    clock.publish(100 * SECOND)
    send(100 * SECOND)
    assert newest() == 100 * SECOND
    send(101 * SECOND)  # before the reset, and read after it
    send(0)  # the first one of the new epoch, sent before its clock
    clock.publish(0, epoch=1)
    assert newest() == 0
    send(SECOND // 10)
    clock.publish(SECOND // 10, epoch=1)
    assert newest() == SECOND // 10
    send(SECOND)  # one that overtakes its clock
    assert newest() == SECOND


class MemoryTf:
    """A clock and a frame ``base`` in ``odom``, whose transforms ``tf echo`` shows."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._bus, self._monkeypatch = MemoryBus(), monkeypatch
        self.clock = ManualClock(self._bus)
        self._publisher = Publisher(TF, TF.name, TF.name[1:], "/base", MemoryTransport(self._bus))
        monkeypatch.setattr(tf, "cli_node", self._node)

    def send(self, time: int) -> None:
        """Publish a transform of simulation time ``time`` [ns]."""
        header = Header(stamp=Time.of(time), frame_id="odom")
        self._publisher.publish(TFMessage(transforms=(TransformStamped(header=header, child_frame_id="base"),)))

    def echo(self, turns: Callable[[], Iterator[None]], rate: float, count: int) -> int:
        """Run ``tf echo`` while ``turns`` publishes before each of its turns; returns the exit status."""
        self._monkeypatch.setattr(tf, "spin", lambda *_: turns())
        options = TfEchoOptions(rate=rate, count=count, timeout=10.0, as_json=True)
        return echo_transform(NetworkAddress("", ""), "odom", "base", options)

    @contextmanager
    def _node(self, address: NetworkAddress, name: str) -> Iterator[LightNode]:
        yield LightNode(MemoryTransport(self._bus), name)


def test_the_first_transform_is_shown_with_its_age_though_it_arrives_before_the_clock(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    frames = MemoryTf(monkeypatch)

    def turns() -> Iterator[None]:
        frames.send(SECOND)
        yield
        frames.clock.publish(3 * SECOND)
        yield

    assert frames.echo(turns, rate=5.0, count=1) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert (json.loads(line)["time"], json.loads(line)["age"]) == (1.0, 2.0)


def test_one_transform_is_shown_in_each_period_of_the_clock(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The clock advances by 40 ms a turn, and skips the periods from 2.0 to 2.4 s; each transform is 40 ms ahead."""
    frames = MemoryTf(monkeypatch)
    clocks = [ms for ms in range(1480, 3480, 40) if not 2000 <= ms < 2400]

    def turns() -> Iterator[None]:
        for ms in clocks:
            frames.send((ms + 40) * SECOND // 1000)
            frames.clock.publish(ms * SECOND // 1000)
            yield

    assert frames.echo(turns, rate=5.0, count=0) == 0
    shown = [round(json.loads(line)["time"] * 1000) - 40 for line in capsys.readouterr().out.splitlines()]
    assert shown == [1480, 1600, 1800, 2400, 2600, 2800, 3000, 3200, 3400]
