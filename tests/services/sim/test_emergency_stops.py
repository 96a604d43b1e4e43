"""Emergency stops and their holders: several holders, restarts, damaged files, full disks, and forged ids."""

from __future__ import annotations

import io
import resource
import signal
from pathlib import Path

import pytest

from messages.std import Bool
from services.runtime.errors import BadInput
from services.runtime.log import Log
from services.runtime.transport.wire import SampleInfo, publisher_id
from services.sim.emergency_stops import ALL_ROBOTS, DAMAGED, FOREIGN, MAX_HOLDERS, OTHERS, EmergencyStopStore


class StopHarness:
    """The simulation's record of emergency stops, with messages from several nodes."""

    def __init__(self, path: Path | None = None, known: tuple[str, ...] = ("/panel", "/tool")) -> None:
        self.out, self.now = io.StringIO(), 0.0
        names = {publisher_id(node, "s", "k")[:6]: node for node in known}
        self.names = names
        self.stops = EmergencyStopStore(
            path, lambda node: names.get(node, ""), Log("/sim", out=self.out), lambda: 10**18, lambda: self.now
        )
        self.stops.load()
        self.stops.save()

    def say(self, node: str, *said: bool, robot: str = "a", session: str = "s") -> bool:
        """Process a node's messages in one session, for a robot or for all; return whether a stop was requested."""
        origin = SampleInfo(1, 0, 16, publisher_id(node, session, "e_stop")) if node else None
        topic = f"/{robot}/e_stop" if robot else "/e_stop"
        asked = self.stops.process(robot, topic, [(Bool(data=each), origin) for each in said])
        self.stops.save()
        return asked

    @property
    def log(self) -> str:
        return self.out.getvalue()


def test_stops_add_up_and_each_holder_resets_its_own() -> None:
    harness = StopHarness()
    harness.say("/panel", True)
    harness.say("/tool", True)
    harness.say("", True)
    harness.say("/panel", True, robot=ALL_ROBOTS)
    assert harness.stops.holders("a") == ("/panel", "/tool", FOREIGN)
    assert harness.stops.holders("b") == ("/panel",)
    harness.say("/tool", False, session="another life")
    harness.say("", False)
    harness.say("/stranger", False)
    assert harness.stops.holders("a") == ("/panel",)
    harness.say("/panel", False)
    assert harness.stops.holders("a") == ("/panel",), "that of all holds"
    harness.say("/panel", False, robot=ALL_ROBOTS)
    assert harness.stops.holders("a") == ()
    assert harness.stops.all == ()
    assert "in memory only" in harness.log


def test_a_stop_that_is_reset_at_once_was_a_stop() -> None:
    harness = StopHarness()
    assert harness.say("/panel", True, False)
    assert not harness.say("/panel", False)
    assert harness.stops.holders("a") == ()


def test_a_restart_keeps_them_and_the_holder_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "stops.json"
    first = StopHarness(path, ())
    first.say("/panel", True)
    first.say("/tool", True, robot=ALL_ROBOTS)
    [stop, _] = first.stops.all
    assert stop.holder == f"#{stop.id}", "its token has not come yet"
    first.names[bytes.fromhex(stop.id)] = "/panel"
    assert first.stops.save()
    assert first.stops.holders("a")[0] == "/panel"

    second = StopHarness(path, ())
    assert second.stops.all == first.stops.all
    assert "emergency stops from before the restart are still active: a, all robots" in second.log
    second.say("/panel", False, session="restarted as well")
    second.stops.release(ALL_ROBOTS)
    second.stops.save()
    assert StopHarness(path).stops.all == ()


def test_a_deleted_robot_takes_its_stops_with_it(tmp_path: Path) -> None:
    harness = StopHarness(tmp_path / "stops.json")
    harness.say("/panel", True)
    harness.say("/panel", True, robot="b")
    harness.stops.remove_robot("a")
    assert harness.stops.save()
    assert [each.robot for each in StopHarness(tmp_path / "stops.json").stops.all] == ["b"]


def test_a_robot_is_not_stopped_by_what_a_deleted_one_of_its_name_had_heard() -> None:
    """A latched stop arrives again while its holder doesn't know of the deletion."""
    harness = StopHarness()
    for _ in range(3):
        harness.say("/panel", True)
        harness.stops.remove_robot("a")
    assert not harness.say("/panel", True)
    assert harness.stops.holders("a") == ()
    again = SampleInfo(2, 1, 16, publisher_id("/panel", "s", "e_stop"))
    assert harness.stops.process("a", "/a/e_stop", [(Bool(data=True), again)])
    assert harness.stops.holders("a") == ("/panel",)


def test_release_names_what_there_is() -> None:
    harness = StopHarness()
    with pytest.raises(BadInput, match=r"no emergency stop of a to release \(active stops: none\)"):
        harness.stops.release("a")
    harness.say("/panel", True)
    harness.say("/tool", True)
    with pytest.raises(BadInput, match=r"no emergency stop of all robots to release \(active stops: a\)"):
        harness.stops.release(ALL_ROBOTS)
    with pytest.raises(BadInput, match=r"a: unknown holder '/pane'; did you mean '/panel'\? \(known: /panel, /tool\)"):
        harness.stops.release("a", "/pane")
    assert harness.stops.release("a", "/panel") == "a: the stop of /panel is released; still stopped by /tool"
    harness.say("/panel", True, robot=ALL_ROBOTS)
    assert harness.stops.release("a", harness.stops.all[0].id).endswith("still stopped by /panel")
    assert harness.stops.release(ALL_ROBOTS) == "all robots: the stop of /panel is released"


def test_a_damaged_file_stops_all_robots_until_that_is_released(tmp_path: Path) -> None:
    path = tmp_path / "stops.json"
    harness = StopHarness(path)
    harness.say("/panel", True)
    sound = path.read_bytes()
    damaged = [sound[:at] + bytes([sound[at] ^ 4]) + sound[at + 1 :] for at in range(0, len(sound), 3)]
    for content in (b"", sound[:-20], b"[]", b"null", b"\xff" * 100, *damaged):
        path.write_bytes(content)
        harness = StopHarness(path)
        assert harness.stops.holders("any") == (DAMAGED,), content
        assert (tmp_path / "stops.json.damaged").read_bytes() == content
    assert "all robots are stopped" in harness.log
    assert "./elea sim release --all" in harness.log
    again = StopHarness(path)
    assert again.stops.holders("any") == (DAMAGED,), "through another restart, too"
    again.stops.release(ALL_ROBOTS)
    again.stops.save()
    assert StopHarness(path).stops.holders("any") == ()
    path.unlink()
    path.mkdir()
    assert StopHarness(path).stops.holders("any") == (DAMAGED,), "nor can a folder be read"


def test_on_a_full_disk_stops_hold_and_are_written_later(tmp_path: Path) -> None:
    path = tmp_path / "stops.json"
    harness = StopHarness(path)
    harness.say("/panel", True)
    before, limit = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, limit[1]))
        harness.say("/tool", True)
        assert harness.stops.holders("a") == ("/panel", "/tool")
        assert path.read_bytes() == before
        assert "they stay active, but would be lost if the simulation restarted now" in harness.log
        harness.now = 1.5
        harness.stops.save()
        assert list(tmp_path.iterdir()) == [path], "nothing half is left"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, ignored)
    harness.stops.save()
    assert path.read_bytes() == before, "only after a while"
    harness.now = 3.0
    assert not harness.stops.save(), "nothing has changed for those who are told"
    assert StopHarness(path).stops.holders("a") == ("/panel", "/tool")
    assert "written to" in harness.log.splitlines()[-1]


def test_forged_ids_fill_nothing(tmp_path: Path) -> None:
    harness = StopHarness(tmp_path / "stops.json")
    for number in range(3 * MAX_HOLDERS):
        harness.say(f"/forged_{number}", True)
    assert len(harness.stops.all) == MAX_HOLDERS + 1
    assert OTHERS in harness.stops.holders("a")
    for number in range(3 * MAX_HOLDERS):
        harness.say(f"/forged_{number}", False)
    assert harness.stops.holders("a") == (OTHERS,), "whose they are nobody knows: only a request releases them"
