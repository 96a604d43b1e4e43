"""The desk in memory: origins, atomic sets, levels, resets, undo, history, retries and schemas that change."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.parameters import (
    HistoryOf,
    ParameterDescription,
    ParameterSchema,
    ParameterSet,
    ParameterValues,
    ResetParameters,
    SetParameters,
    UndoParameters,
)
from messages.std import Empty
from services.params.desk import Desk
from services.params.store import opened
from services.runtime.errors import BadInput
from services.runtime.log import Log
from tests.messages.strategies import STEADY
from tests.params.sets import ARM, arm, plain, values

SET = "/robot_control"


class Counter:
    """A desk, what it told, and what it logged."""

    def __init__(self, desk: Desk, told: list[Any], out: io.StringIO, alive: set[str]) -> None:
        self.desk, self.told, self.out, self.alive = desk, told, out, alive

    def set(self, clamp: bool = False, run: bool = False, request: str = "", **given: Any) -> ParameterValues:
        return self.desk.set(SetParameters(set=SET, values=values(**given), clamp=clamp, run=run, id=request, who="me"))

    def reset(self, *names: str) -> ParameterValues:
        return self.desk.reset(ResetParameters(set=SET, names=names))

    def undo(self, request: str = "") -> ParameterValues:
        return self.desk.undo(UndoParameters(set=SET, id=request))

    def get(self) -> dict[str, Any]:
        return plain(self.record())

    def record(self) -> ParameterValues:
        return self.desk.get(ParameterSet(set=SET))

    def origins(self) -> dict[str, str]:
        return {each.name: each.origin for each in self.record().values}

    def history(self) -> list[Any]:
        return list(self.desk.history(HistoryOf(set=SET)).changes)


@contextmanager
def counter(file: str = "") -> Iterator[Counter]:
    with opened(file) as store:
        told: list[Any] = []
        out, alive = io.StringIO(), {"/arm", "/reference"}
        desk = Desk(store, told.append, Log("/params", out=out), lambda: 1_500_000_000, alive.__contains__)
        yield Counter(desk, told, out, alive)


@pytest.fixture
def at() -> Iterator[Counter]:
    with counter() as made:
        made.desk.announce(arm(fleet=values(ref_angle=20), command_line=values(tr_Kp=5)))
        yield made


def test_the_latest_origin_wins(at: Counter) -> None:
    assert at.get()["ss_Kp"] == 37.5
    assert at.get()["ref_angle"] == 20.0
    at.set(ref_angle=10, ss_Kp=2)
    at.set(run=True, ss_Kp=3)
    origins = at.origins()
    assert (origins["window"], origins["ref_angle"], origins["tr_Kp"], origins["ss_Kp"]) == (
        "default",
        "saved",
        "command line",
        "run",
    )
    assert at.set(ss_Kp=4).values[2].origin == "saved"


def test_what_is_set_counts_at_once_even_where_the_command_line_has_a_word(at: Counter) -> None:
    reply = at.set(tr_Kp=6)
    assert at.get()["tr_Kp"] == 6.0
    assert "the command line says 5.0" in reply.note
    at.desk.new_run()
    assert at.get()["tr_Kp"] == 5.0


def test_a_set_is_whole_or_not_at_all_and_names_every_violation(at: Counter) -> None:
    before = at.record()
    with pytest.raises(BadInput) as caught:
        at.set(ref_angle=95, ss_Kp=1, reference_type="sinus", windw=1, file="x", feed_forward=1)
    text = str(caught.value)
    for part in (
        "ref_angle = 95.0 is out of bounds: -90 to 90 deg",
        "reference_type = 'sinus': expected one of step, sine",
        "unknown parameter 'windw'; did you mean 'window'?",
        "file cannot change while /arm runs",
        "feed_forward = 1: it is an int, expected bool",
        "nothing was changed",
    ):
        assert part in text
    assert at.record() == before
    assert not at.history()


def test_the_level_is_the_union_of_what_changed(at: Counter) -> None:
    schema, first = at.told
    assert isinstance(schema, ParameterSchema)
    assert first.level == 2**32 - 1
    assert at.set(reference_type="sine", ss_Kp=1, window=2).level == 2 | 4
    assert at.told[-1].level == 2 | 4
    assert [each.revision for each in at.told[1:]] == [1, 2]


def test_clamp_on_request(at: Counter) -> None:
    reply = at.set(clamp=True, ref_angle=400, window=-3)
    assert (plain(reply)["ref_angle"], plain(reply)["window"]) == (90.0, 1)
    assert "ref_angle = 400.0 was clamped to 90.0" in reply.note


def test_reset_forgets_what_was_set(at: Counter) -> None:
    at.set(ref_angle=10, ss_Kp=2)
    at.set(run=True, window=9)
    assert plain(at.reset("ref_angle"))["ref_angle"] == 20.0
    assert at.get()["ss_Kp"] == 2.0
    at.reset()
    assert (at.get()["ss_Kp"], at.get()["window"]) == (37.5, 2)
    assert at.reset().note == "nothing was set"
    with pytest.raises(BadInput, match=r"unknown parameter 'ss_kp'; did you mean 'ss_Kp'"):
        at.reset("ss_kp")


def test_undo_goes_back_change_by_change(at: Counter) -> None:
    at.set(ref_angle=10)
    at.set(ref_angle=11, ss_Kp=2)
    at.reset()
    assert plain(at.undo())["ref_angle"] == 11.0
    assert plain(at.undo())["ref_angle"] == 10.0
    assert (at.get()["ss_Kp"], at.get()["ref_angle"]) == (37.5, 10.0)
    assert at.origins()["ss_Kp"] == "default"
    at.undo()
    assert at.origins()["ref_angle"] == "fleet"
    with pytest.raises(BadInput, match="there is no change to take back"):
        at.undo()
    kinds = [(each.kind, each.undone) for each in reversed(at.history())]
    assert kinds == [("set", True), ("set", True), ("reset", True), ("undo", False), ("undo", False), ("undo", False)]


def test_history_says_who_when_and_from_what_to_what(at: Counter) -> None:
    at.set(ref_angle=10)
    at.set(run=True, ref_angle=11)
    newest, first = at.history()
    assert (first.who, first.sim_time.ns, first.revision, first.run) == ("me", 1_500_000_000, 2, False)
    assert (first.before, first.after) == (values(ref_angle=20.0), values(ref_angle=10.0))
    assert first.wall_time > 1_700_000_000 * 10**9
    assert newest.run


def test_a_retry_with_the_same_id_applies_once_and_gets_the_same_answer(at: Counter) -> None:
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
    with counter(file) as at:
        at.desk.announce(arm())
        first = at.set(request="a", ref_angle=10, limits=(1, 2.5), offset=None)
        at.set(request="r", run=True, ss_Kp=1)
    with counter(file) as at:
        assert [each.set for each in at.desk.list(Empty()).sets] == [SET]
        assert at.get() == {"ref_angle": 10.0, "limits": (1.0, 2.5), "offset": None}
        assert "no running service has announced this set" in at.record().note
        with pytest.raises(BadInput, match=r"no running service has announced /robot_control \(saved values are kept"):
            at.set(ref_angle=1)
        answer = at.desk.announce(arm())
        assert (plain(answer)["ref_angle"], plain(answer)["ss_Kp"]) == (10.0, 37.5)
        assert answer.revision > first.revision
        assert at.set(request="a", ref_angle=10, limits=(1, 2.5), offset=None) == first
        assert at.undo().revision > answer.revision, "the change of the last run, which is over, is left out"
        assert at.get()["ref_angle"] == 30.0


def test_who_comes_back_gets_what_counts_now(at: Counter) -> None:
    at.set(run=True, ref_angle=11)
    told = len(at.told)
    again = at.desk.announce(arm(fleet=values(ref_angle=20), command_line=values(tr_Kp=5)))
    assert plain(again)["ref_angle"] == 11.0
    assert len(at.told) == told


def test_a_node_that_has_gone_has_no_say(at: Counter) -> None:
    new = (replace(ARM[1], high=45.0),)
    with pytest.raises(BadInput, match="describe /robot_control ref_angle differently"):
        at.desk.announce(arm(node="/other", parameters=new))
    at.alive.clear()
    assert plain(at.desk.announce(arm(node="/other", parameters=new))) == {"ref_angle": 30.0}
    assert "/arm has gone" in at.out.getvalue()


OLD = (
    ParameterDescription(name="gain", type="int", default=1, low=0, high=10),
    ParameterDescription(name="speed", default=1.0, low=0, high=5),
    ParameterDescription(name="kind", type="str", default="a", choices=("a", "b")),
    ParameterDescription(name="old_name", default=1.0),
    ParameterDescription(name="count", type="float", default=1.0),
)
NEW = (
    ParameterDescription(name="gain", type="float", default=1.0, low=0, high=10),
    ParameterDescription(name="speed", default=1.0, low=0, high=2),
    ParameterDescription(name="kind", type="str", default="a", choices=("a", "c")),
    ParameterDescription(name="new_name", default=1.0),
    ParameterDescription(name="count", type="int", default=1),
)


def test_saved_values_under_a_changed_schema_are_migrated_or_left_out_and_it_is_said(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with counter(file) as at:
        at.desk.announce(arm(parameters=OLD))
        at.set(gain=7, speed=4, kind="b", old_name=3, count=2)
    with counter(file) as at:
        answer = at.desk.announce(arm(parameters=NEW))
        expected = {"gain": 7.0, "speed": 1.0, "kind": "a", "new_name": 1.0, "count": 2}
        assert repr(plain(answer)) == repr(expected)
        for text in (answer.note, at.told[-1].note, at.out.getvalue()):
            assert "saved gain = 7 became 7.0: its type is float now" in text
            assert "saved speed = 4.0 was left out: speed = 4.0 is out of bounds: 0 to 2" in text
            assert "saved kind = 'b' was left out: kind = 'b': expected one of a, c" in text
            assert "saved old_name = 3.0 was left out: no parameter has this name any more" in text
            assert "if it is called new_name now, set that" in text
            assert "saved count = 2.0 became 2: its type is int now" in text
        newest = at.history()[0]
        assert newest.kind == "migrated"
        assert {each.name for each in newest.before} == {"gain", "speed", "kind", "old_name", "count"}
    with counter(file) as at:
        assert at.desk.announce(arm(parameters=NEW)).note == ""


def test_an_undo_cannot_bring_back_what_fits_no_longer(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with counter(file) as at:
        at.desk.announce(arm(parameters=OLD))
        at.set(speed=4)
        at.reset()
    with counter(file) as at:
        at.desk.announce(arm(parameters=NEW))
        with pytest.raises(BadInput, match=r"cannot be taken back, its schema has changed: speed = 4\.0"):
            at.undo()
        assert at.get()["speed"] == 1.0


def test_values_wait_for_a_node_that_is_late(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with counter(file) as at:
        at.desk.announce(arm(node="/arm", parameters=ARM[2:]))
        at.desk.announce(arm(node="/reference", parameters=ARM[:2]))
        at.set(ref_angle=10, ss_Kp=2)
    with counter(file) as at:
        answer = at.desk.announce(arm(node="/arm", parameters=ARM[2:]))
        assert "ref_angle = 10.0 is kept for /reference" in answer.note
        assert at.history()[0].kind != "migrated"
        assert "WARN" not in at.out.getvalue()
        assert plain(at.desk.announce(arm(node="/reference", parameters=ARM[:2])))["ref_angle"] == 10.0


def test_a_new_run_forgets_what_was_for_the_last(at: Counter) -> None:
    at.set(ref_angle=10)
    at.set(run=True, ref_angle=11)
    at.desk.new_run()
    assert at.get()["ref_angle"] == 10.0
    assert "a new run" in at.told[-1].note
    assert plain(at.undo())["ref_angle"] == 20.0
    told = len(at.told)
    at.desk.new_run()
    assert len(at.told) == told


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


@STEADY
@given(steps=st.lists(STEPS, max_size=12))
def test_undoing_everything_gives_what_was_there_first(steps: list[Any]) -> None:
    with counter() as at:
        at.desk.announce(arm(fleet=values(ref_angle=20), command_line=values(tr_Kp=5)))
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
