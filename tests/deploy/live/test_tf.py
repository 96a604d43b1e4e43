"""The frames of ``tf echo`` and ``tf tree`` on an in-memory bus."""

from __future__ import annotations

import json
from collections.abc import Iterator
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


def test_the_first_transform_is_shown_with_its_age_though_it_arrives_before_the_clock(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bus = MemoryBus()
    clock, publisher = ManualClock(bus), Publisher(TF, TF.name, TF.name[1:], "/base", MemoryTransport(bus))

    @contextmanager
    def node(address: NetworkAddress, name: str) -> Iterator[LightNode]:
        yield LightNode(MemoryTransport(bus), name)

    def turns(*arguments: object) -> Iterator[None]:
        header = Header(stamp=Time.of(SECOND), frame_id="odom")
        publisher.publish(TFMessage(transforms=(TransformStamped(header=header, child_frame_id="base"),)))
        yield
        clock.publish(3 * SECOND)
        yield

    monkeypatch.setattr(tf, "cli_node", node)
    monkeypatch.setattr(tf, "spin", turns)
    options = TfEchoOptions(rate=5.0, count=1, timeout=10.0, as_json=True)
    assert echo_transform(NetworkAddress("", ""), "odom", "base", options) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert (json.loads(line)["time"], json.loads(line)["age"]) == (1.0, 2.0)
