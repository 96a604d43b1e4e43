"""The frames of ``tf echo`` and ``tf tree`` on an in-memory bus."""

from __future__ import annotations

from deploy.live.tf import TfMonitor
from messages.geometry import TransformStamped
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import TF
from services.runtime.light_node import LightNode
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
