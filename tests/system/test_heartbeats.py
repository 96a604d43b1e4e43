"""Heartbeats beside a flood of data on the same link: all of them arrive, so no sound process looks hung."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.processes import Network
from tests.system.flooder import BEAT, BEATS, FLOOD
from tests.waiting import until


@pytest.mark.parametrize("topology", ["direct", "star"])
def test_no_flood_takes_a_heartbeat_away(tmp_path: Path, topology: str) -> None:
    with Network(tmp_path) as network, network.node() as node:
        beats, flood = node.read(BEAT), node.read(FLOOD)
        flooder = network.run(Path(__file__).with_name("flooder.py"), "--topology", topology)

        def ended() -> bool:
            flood.admit()
            beats.admit()
            assert flooder.status is None, flooder.text
            return beats.received + beats.lost == BEATS and "sent" in flooder.text

        until(ended, 30.0, "the flood to end")
        assert flood.lost > 0, "it was no flood"
        assert (beats.received, beats.lost) == (BEATS, 0)
