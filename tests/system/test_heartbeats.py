"""Heartbeats during a flood of data on the same link: all arrive, so no healthy process appears hung."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.system.flood_publisher import FLOOD, HEARTBEAT, HEARTBEATS


@pytest.mark.parametrize("topology", ["direct", "star"])
def test_no_flood_takes_a_heartbeat_away(tmp_path: Path, topology: str) -> None:
    with Network(tmp_path) as network, network.node() as node:
        beats, flood = node.subscribe(HEARTBEAT), node.subscribe(FLOOD)
        flooder = network.run(Path(__file__).with_name("flood_publisher.py"), "--topology", topology)

        def ended() -> bool:
            flood.update()
            beats.update()
            assert flooder.status is None, flooder.text
            return beats.received + beats.lost == HEARTBEATS and "sent" in flooder.text

        wait_until(ended, 30.0, "the flood to end")
        assert flood.lost > 0, "it was no flood"
        assert (beats.received, beats.lost) == (HEARTBEATS, 0)
