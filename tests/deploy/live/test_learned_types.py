"""Other processes, such as commands, learn the types that a script announces; a hostile announcement does no harm."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.interfaces import service_interface
from deploy.live.learned_types import record_on_network
from messages.base import decoder, encode
from messages.elea import InterfaceDefinition, InterfaceDefinitions
from messages.interfaces import catalogue
from messages.interfaces.records import forget_learned
from messages.topics import INTERFACES
from services.runtime.interfaces import InterfaceAnnouncer
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_kernel import memory_kernel
from tests.harness.memory_node import memory_node


@pytest.fixture
def walking(tmp_path: Path) -> Iterator[None]:
    """Run in a workspace that has the package ``walking``."""
    for name, text in (
        ("msg/Step.msg", "Header header\nfloat32 length\n"),
        ("srv/Ask.srv", "int64 a\n---\nStep step\n"),
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    catalogue().add_package("walking", tmp_path)
    yield
    catalogue.cache_clear()
    forget_learned()


def test_what_a_script_uses_is_known_to_others(walking: None) -> None:
    bus = MemoryBus()
    with memory_kernel(bus) as script:
        script.start("/walker", "/", "script")
        script.advertise("/step", "walking/Step")
        script.serve("/ask", "walking/Ask", lambda payload: payload)
        script.subscribe("/chatter", "std_msgs/String", lambda payload, origin: None)
        catalogue.cache_clear()  # like another process, without this workspace
        transport = MemoryTransport(bus)
        record = record_on_network(transport, "walking/Step")
        assert record is not None
        assert decoder(record)(encode({"length": 2})) == record(length=2.0)
        service = service_interface("walking/Ask")
        assert service is not None
        assert encode(service.response_type()) == encode({"step": record()})
        assert record_on_network(transport, "walking/Stop") is None


def test_only_own_types_are_announced_and_each_once(walking: None) -> None:
    bus = MemoryBus()
    with memory_node(bus, "walker") as node:
        announcer = InterfaceAnnouncer(node)
        announcer.add("std_msgs/String", "nowhere/Nothing")
        assert INTERFACES.name not in [each.name for each in node.publishers]
        for _ in range(3):
            announcer.add("walking/Step")
        [publisher] = [each for each in node.publishers if each.name == INTERFACES.name]
        assert publisher.sent == 1


def test_a_hostile_announcement_is_noted_and_harms_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    bus = MemoryBus()
    with memory_node(bus, "attacker") as node:
        out = node.advertise(INTERFACES)
        bad = [InterfaceDefinition(type=f"evil/T{n}", text=text) for n, text in enumerate(["12 wheels", "evil/T1 a\n"])]
        out.publish(InterfaceDefinitions(definitions=tuple(bad)))
        assert record_on_network(MemoryTransport(bus), "evil/T0") is None
    shown = capsys.readouterr().err
    assert "'12 wheels' is not a field" in shown
    assert "evil/T1 contains itself" in shown
