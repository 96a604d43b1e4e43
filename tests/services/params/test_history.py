"""The parameter server's past: undo, history, retries under one id, and the file for the next service."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.std import Empty
from services.runtime.errors import BadInput
from tests.messages.strategies import DETERMINISTIC
from tests.services.params.parameter_client import arm_announcement, assignments, value_dict
from tests.services.params.server_harness import SET, ServerHarness, server_harness


def test_undo_goes_back_change_by_change(at: ServerHarness) -> None:
    at.set(ref_angle=10)
    at.set(ref_angle=11, ss_Kp=2)
    at.reset()
    assert value_dict(at.undo())["ref_angle"] == 11.0
    assert value_dict(at.undo())["ref_angle"] == 10.0
    assert (at.get()["ss_Kp"], at.get()["ref_angle"]) == (37.5, 10.0)
    assert at.origins()["ss_Kp"] == "default"
    at.undo()
    assert at.origins()["ref_angle"] == "fleet"
    with pytest.raises(BadInput, match="there is no change to undo"):
        at.undo()
    kinds = [(each.kind, each.undone) for each in reversed(at.history())]
    assert kinds == [("set", True), ("set", True), ("reset", True), ("undo", False), ("undo", False), ("undo", False)]


def test_history_says_who_when_and_from_what_to_what(at: ServerHarness) -> None:
    at.set(ref_angle=10)
    at.set(run=True, ref_angle=11)
    newest, first = at.history()
    assert (first.who, first.sim_time.ns, first.revision, first.run) == ("me", 1_500_000_000, 2, False)
    assert (first.before, first.after) == (assignments(ref_angle=20.0), assignments(ref_angle=10.0))
    assert first.wall_time > 1_700_000_000 * 10**9
    assert newest.run


def test_a_clock_on_the_wall_that_goes_back_changes_no_order(
    at: ServerHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    for wall, value in ((2 * 10**18, 10), (10**18, 11), (0, 12)):
        monkeypatch.setattr("services.params.server.time.time_ns", lambda wall=wall: wall)
        at.set(ref_angle=value)
    assert [each.after[0].value for each in at.history()] == [12.0, 11.0, 10.0]
    assert [each.wall_time for each in at.history()] == [0, 10**18, 2 * 10**18]
    assert value_dict(at.undo())["ref_angle"] == 11.0


def test_a_retry_with_the_same_id_applies_once_and_gets_the_same_answer(at: ServerHarness) -> None:
    first = at.set(request="a", ref_angle=10)
    at.set(request="b", ref_angle=11)
    assert at.set(request="a", ref_angle=10) == first
    assert at.get()["ref_angle"] == 11.0
    assert len(at.history()) == 2
    with pytest.raises(BadInput, match="'a' was used for another request"):
        at.set(request="a", ref_angle=12)
    undone = at.undo(request="c")
    assert at.undo(request="c") == undone
    assert at.get()["ref_angle"] == 10.0


def test_what_was_set_is_there_for_the_next_service(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with server_harness(file) as at:
        at.server.announce(arm_announcement())
        first = at.set(request="a", ref_angle=10, limits=(1, 2.5), offset=None)
        at.set(request="r", run=True, ss_Kp=1)
    with server_harness(file) as at:
        assert [each.set for each in at.server.list(Empty()).sets] == [SET]
        assert at.get() == {"ref_angle": 10.0, "limits": (1.0, 2.5), "offset": None}
        assert "no running service has announced this set" in at.record().note
        with pytest.raises(BadInput, match=r"no running service has announced /robot_control \(saved values are kept"):
            at.set(ref_angle=1)
        answer = at.server.announce(arm_announcement())
        assert (value_dict(answer)["ref_angle"], value_dict(answer)["ss_Kp"]) == (10.0, 37.5)
        assert answer.revision > first.revision
        assert at.set(request="a", ref_angle=10, limits=(1, 2.5), offset=None) == first
        assert at.undo().revision > answer.revision, "the change of the last run, which is over, is left out"
        assert at.get()["ref_angle"] == 30.0


def test_a_new_run_forgets_what_was_for_the_last(at: ServerHarness) -> None:
    at.set(ref_angle=10)
    at.set(run=True, ref_angle=11)
    at.server.new_run()
    assert at.get()["ref_angle"] == 10.0
    assert "a new run" in at.published[-1].note
    assert value_dict(at.undo())["ref_angle"] == 20.0
    told = len(at.published)
    at.server.new_run()
    assert len(at.published) == told


def test_a_change_is_taken_back_by_its_revision_without_what_came_after(at: ServerHarness) -> None:
    first = at.set(ref_angle=10, ss_Kp=2)
    at.set(ss_Kp=3, window=5)
    at.set(window=6)
    at.undo()
    undone = at.undo_revision(first.revision)
    assert (value_dict(undone)["ref_angle"], value_dict(undone)["ss_Kp"], value_dict(undone)["window"]) == (
        20.0,
        3.0,
        5,
    )
    again = at.undo_revision(first.revision)
    assert again.values == undone.values
    assert "is undone already" in again.note
    with pytest.raises(BadInput, match="no change that made revision 99 to undo"):
        at.undo_revision(99)
    assert value_dict(at.undo())["ss_Kp"] == 2.0
    assert at.get()["ref_angle"] == 20.0
    with pytest.raises(BadInput, match="there is no change to undo"):
        at.undo()


def test_a_retry_that_reaches_the_next_service_applies_once(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with server_harness(file) as at:
        at.server.announce(arm_announcement())
        at.set(request="a", ref_angle=10)
        at.set(request="b", ref_angle=11)
        undone = at.undo(request="c")
    with server_harness(file) as at:
        at.server.announce(arm_announcement())
        assert at.undo(request="c") == undone
        assert value_dict(at.set(request="a", ref_angle=10))["ref_angle"] == 10.0
        assert at.get()["ref_angle"] == 10.0
        assert [each.kind for each in at.history()] == ["undo", "set", "set"]


def test_reset_gives_what_the_fleet_says_now(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with server_harness(file) as at:
        at.server.announce(arm_announcement(fleet=assignments(ref_angle=20)))
        at.set(ref_angle=10)
    with server_harness(file) as at:
        at.server.announce(arm_announcement(fleet=assignments(ref_angle=25)))
        assert at.get()["ref_angle"] == 10.0
        assert value_dict(at.reset("ref_angle"))["ref_angle"] == 25.0
        assert value_dict(at.undo())["ref_angle"] == 10.0


GIVEN = st.dictionaries(st.sampled_from(("ref_angle", "ss_Kp", "tr_Kp")), st.integers(-20, 120), min_size=1)


STEPS = st.one_of(
    st.tuples(
        st.just("set"),
        st.booleans(),
        GIVEN,
    ),
    st.tuples(st.just("reset"), st.lists(st.sampled_from(("ref_angle", "ss_Kp")), max_size=2, unique=True)),
    st.tuples(st.just("undo")),
)


@DETERMINISTIC
@given(steps=st.lists(STEPS, max_size=12))
def test_undoing_everything_gives_what_was_there_first(steps: list[Any]) -> None:
    with server_harness() as at:
        at.server.announce(arm_announcement(fleet=assignments(ref_angle=20), command_line=assignments(tr_Kp=5)))
        first, revision = at.record().values, 1
        for kind, *more in steps:
            before = at.record()
            try:
                if kind == "set":
                    record = at.set(run=more[0], **more[1])
                else:
                    record = at.reset(*more[0]) if kind == "reset" else at.undo()
            except BadInput:
                assert at.record() == before
                continue
            assert record.values == at.record().values
            assert record.revision >= revision
            revision = record.revision
        while True:
            try:
                at.undo()
            except BadInput:
                break
        assert at.record().values == first
