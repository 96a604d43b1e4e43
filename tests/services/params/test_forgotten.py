"""Sets that come and go under ever new names: data no longer needed is forgotten everywhere."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from messages.parameters import (
    Announcement,
    ParameterDescription,
    ParameterSchema,
    ParameterValues,
    SetParameters,
)
from messages.std import Empty
from messages.topics import HEALTH
from services.params.loop import MAX_CLOSING, SetPublishers
from services.params.server import MAX_NODES
from services.runtime.errors import BadInput
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node
from tests.harness.message_recorder import MessageRecorder
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.services.params.parameter_client import (
    arm_announcement,
    assignments,
    connected_client,
    start_and_wait,
    value_dict,
)
from tests.services.params.server_harness import SET, ServerHarness, server_harness


def leaving(name: str, node: str) -> Announcement:
    return Announcement(set=name, node=node, leaves=True)


def rows(file: Path, table: str) -> int:
    with closing(sqlite3.connect(file)) as connection:
        count: int = connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
    return count


def test_robots_that_come_and_go_leave_nothing_in_the_service_nor_in_its_file(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    with Network(tmp_path) as network, connected_client(network) as client, network.node() as node:
        start_and_wait(network, client, file)
        health = MessageRecorder(node.subscribe(HEALTH))

        def topics() -> set[str]:
            beats = [each for each in health.received() if each.node == "/params"]
            return {each.topic for each in beats[-1].outputs} if beats else set()

        own = wait_until(topics, 10.0, "a heartbeat of the service")
        for number in range(40):
            name = f"/r{number:04}/base"
            assert client.announce(arm_announcement(name, "/sim")).revision == 1
            client.announce(leaving(name, "/sim"))
        client.announce(arm_announcement("/last/base", "/sim"))
        wait_until(lambda: "/last/base/parameter_updates" in topics(), 10.0, "the last set in the heartbeat")
        assert topics() == own | {"/last/base/parameter_updates", "/last/base/parameter_descriptions"}
    assert [rows(file, table) for table in ("saved", "history", "requests")] == [0, 0, 0]


def test_what_is_saved_is_kept_until_it_is_reset_and_revisions_go_on() -> None:
    with server_harness() as at:
        at.server.announce(arm_announcement())
        at.set(ss_Kp=2)
        at.server.announce(leaving(SET, "/arm"))
        assert value_dict(at.record())["ss_Kp"] == 2.0
        assert at.ended == []
        last = at.reset().revision
        assert at.ended == [SET]
        assert at.server.announced_sets == set()
        assert at.undo().revision == last + 1, "its past is kept, and what was reset can come back"
        assert value_dict(at.server.announce(arm_announcement()))["ss_Kp"] == 2.0
        at.reset()
        at.server.announce(leaving(SET, "/arm"))
        assert at.ended == [SET, SET]
        assert at.server.announce(arm_announcement()).revision > last + 1
        with pytest.raises(BadInput, match="unknown set of parameters '/robot_contrl'; did you mean '/robot_control'"):
            at.server.announce(leaving("/robot_contrl", "/arm"))


def test_there_is_room_for_so_many_and_the_dead_give_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.params.server.MAX_SETS", 5)
    monkeypatch.setattr("services.params.server.LIVENESS_PERIOD_S", 0.0)
    with server_harness() as at:
        at.server.announce(arm_announcement())
        at.set(ss_Kp=2)
        at.server.announce(leaving(SET, "/arm"))
        for number in range(20):
            at.server.announce(arm_announcement(f"/r{number}/base", f"/killed{number}"))
        assert len([each for each in at.server.announced_sets if each.endswith("/base")]) <= 4
        for number in range(4):
            at.server.announce(arm_announcement(f"/s{number}/base", "/sim"))
        at.alive.add("/sim")
        with pytest.raises(BadInput, match=r"/t/base: there are 5 sets .*; 1 of them hold only saved values"):
            at.server.announce(arm_announcement("/t/base", "/sim"))
        at.reset()
        at.server.announce(arm_announcement("/t/base", "/sim"))
        monkeypatch.setattr("services.params.server.MAX_BYTES", 100)
        with pytest.raises(BadInput, match="the limit is 100"):
            at.server.announce(arm_announcement("/t/base", "/sim", parameters=()))


@pytest.mark.slow
def test_a_set_is_shared_by_so_many_and_remembers_as_many_that_have_gone(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    with server_harness(str(file)) as at:
        for number in range(3 * MAX_NODES):
            at.alive.add(f"/n{number}")
            at.server.announce(arm_announcement(node=f"/n{number}"))
            at.set(ss_Kp=number)
            if number:
                at.server.announce(leaving(SET, f"/n{number}"))
        at.alive.update(f"/m{number}" for number in range(MAX_NODES))
        for number in range(MAX_NODES - 1):
            at.server.announce(arm_announcement(node=f"/m{number}"))
        with pytest.raises(BadInput, match=f"{MAX_NODES} nodes share it"):
            at.server.announce(arm_announcement(node="/m99"))
    assert rows(file, "saved") == 1


def test_of_sets_that_were_only_announced_nothing_is_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    for life in range(3):
        with server_harness(str(file)) as at:
            if not life:
                at.server.announce(arm_announcement())
                at.set(ss_Kp=2)
            for number in range(10):
                assert at.server.announce(arm_announcement(f"/life{life}/r{number}", "/sim")).revision == 1
        assert [rows(file, table) for table in ("saved", "history")] == [1, 1]
    with server_harness(str(file)) as at:
        assert value_dict(at.record())["ss_Kp"] == 2.0
        assert [each.set for each in at.server.list(Empty()).sets] == [SET]


def test_values_saved_under_ever_new_names_find_an_end(at: ServerHarness) -> None:
    def save(number: int) -> None:
        text = ParameterDescription(name=f"t{number}", type="str", default="")
        at.server.announce(arm_announcement("/texts", "/arm", parameters=(text,)))
        at.server.set(SetParameters(set="/texts", values=assignments(**{text.name: "x" * 60_000})))

    for number in range(17):
        save(number)
    with pytest.raises(BadInput, match=r"/texts would have 10\d{5} bytes in a message, the limit is 1048576"):
        save(17)


def test_what_its_readers_would_refuse_is_not_set(at: ServerHarness) -> None:
    texts: dict[str, Any] = {f"t{number}": "x" * 60_000 for number in range(20)}
    at.server.announce(
        arm_announcement(
            "/texts",
            "/arm",
            parameters=tuple(ParameterDescription(name=each, type="str", default="") for each in texts),
        )
    )
    with pytest.raises(BadInput, match=r"/texts would have 12\d{5} bytes in a message, the limit is 1048576"):
        at.server.set(SetParameters(set="/texts", values=assignments(**texts)))
    assert len(at.published) == 4


@pytest.mark.slow
def test_the_most_work_that_announcements_and_changes_can_make_is_bounded(at: ServerHarness) -> None:
    """Counts compared pairs of characters and written sentences, not time."""
    names = [f"{'ab' * 40}{number:04}" for number in range(1000)]
    at.server.announce(
        arm_announcement("/wide", "/arm", parameters=tuple(ParameterDescription(name=each) for each in names))
    )
    at.server.set(SetParameters(set="/wide", values=assignments(**dict.fromkeys(names, 1.0))))
    others = [f"{'ba' * 40}{number:04}" for number in range(1000)]
    with pytest.raises(BadInput) as caught:
        at.server.set(SetParameters(set="/wide", values=assignments(**dict.fromkeys(others, 1.0))))
    assert str(caught.value).count("unknown parameter") == 10
    migrated = at.server.announce(
        arm_announcement("/wide", "/arm", parameters=tuple(ParameterDescription(name=each) for each in others))
    )
    assert migrated.note.count("it is kept") == 20
    assert migrated.note.endswith("980 more notes")
    assert migrated.note.count("was it renamed to") <= 10


def test_in_lockstep_a_publication_ends_after_its_last_message_has_counted(bus: MemoryBus) -> None:
    with memory_node(bus, "params") as made:
        own = {each.name for each in made.publishers}
        publications = SetPublishers(made, at_once=False)
        news = ParameterSchema(set="/r1/base"), ParameterValues(set="/r1/base")
        for each in news:
            publications.publish(each)
        publications.close("/r1/base")
        open_ = []
        for _ in range(4):
            publications.tick()
            open_.append(len({each.name for each in made.publishers} - own))
        assert open_ == [2, 2, 0, 0], "the tick in which it was sent, and the one in which it counts"
        publications.publish(news[0])
        publications.close("/r1/base")
        publications.publish(news[0])
        for _ in range(4):
            publications.tick()
        assert len({each.name for each in made.publishers} - own) == 2, "it came back before its end"
        for number in range(300):
            publications.publish(ParameterSchema(set=f"/s{number}"))
            publications.close(f"/s{number}")
        assert len({each.name for each in made.publishers} - own) <= 2 * (MAX_CLOSING + 1)
