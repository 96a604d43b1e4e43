"""Key scripts: the events that a keyboard would send."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.errors import BadInput
from services.teleop import TeleopParameters
from services.teleop.keys import KeyEvent
from services.teleop.script import KeyScript, script_events


def times(keys: str, **more: float) -> list[float]:
    return [each.time for each in script_events(TeleopParameters(keys=keys, **more))]  # type: ignore[arg-type]


def test_a_tap_is_one_event() -> None:
    assert script_events(TeleopParameters(keys="i@0.5 space@2")) == (KeyEvent("i", 0.5), KeyEvent(" ", 2.0))


def test_a_held_key_repeats_after_its_delay() -> None:
    assert times("i@1-1.6") == pytest.approx([1.0, 1.5, 1.53, 1.56, 1.59])
    assert times("i@1-1.49") == [1.0]
    assert times("i@0-1", key_delay=0.25, key_interval=0.25) == pytest.approx([0, 0.25, 0.5, 0.75, 1.0])


def test_a_key_repeats_no_more_once_another_is_struck() -> None:
    assert [each.key for each in script_events(TeleopParameters(keys="up@1 left@2"))] == ["up", "left"]
    found = script_events(TeleopParameters(keys="i@0-10 l@0.55"))
    assert [(each.key, round(each.time, 2)) for each in found] == [("i", 0), ("i", 0.5), ("i", 0.53), ("l", 0.55)]


def test_a_repeat_gives_way_to_a_key_struck_at_the_same_time() -> None:
    assert times("i@7.089-9.089 i@8.309")[-2:] == pytest.approx([8.279, 8.309])


def test_the_keys_that_look_like_marks_are_keys() -> None:
    assert [each.key for each in script_events(TeleopParameters(keys=",@1 <@2 @@3 -@4-4.1"))] == [",", "<", "@", "-"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("i", "'i' is not KEY@TIME"),
        ("ii@1", "'ii@1' is not"),
        ("i@", "'i@' is not"),
        ("i@-1", "is not"),
        ("i@nan", "is not"),
        ("i@2-1", "the release must not be earlier than the press"),
        ("i@1-999999", "nor later than 100000 s"),
        ("i@1-99999", "at most 100000 events"),
        ("ö@1", "is not"),
    ],
)
def test_what_is_no_script_is_refused(keys: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        script_events(TeleopParameters(keys=keys))


@given(st.lists(st.tuples(st.sampled_from("ilqk"), st.floats(0, 20), st.floats(0, 5)), max_size=8))
def test_events_come_in_order_and_within_their_holds(holds: list[tuple[str, float, float]]) -> None:
    keys = " ".join(f"{key}@{start:.3f}-{start + span:.3f}" for key, start, span in holds)
    found = script_events(TeleopParameters(keys=keys))
    assert list(found) == sorted(found, key=lambda each: each.time)
    for each in found:
        assert any(k == each.key and s - 1e-3 <= each.time <= s + d + 2e-3 for k, s, d in holds)


def test_each_press_is_handed_out_once_at_its_time() -> None:
    script = KeyScript((KeyEvent("i", 0.5), KeyEvent("i", 0.6), KeyEvent("k", 2.0)))
    assert script.pop_due(0.4) == []
    assert script.pop_due(1.0) == [KeyEvent("i", 0.5), KeyEvent("i", 0.6)]
    assert script.pop_due(1.0) == []
    assert not script.done
    assert script.pop_due(2.0) == [KeyEvent("k", 2.0)]
    assert script.done
    script.rewind()
    assert not script.done
    assert script.pop_due(0.5) == [KeyEvent("i", 0.5)]


def test_no_script_is_done_at_once() -> None:
    assert KeyScript(script_events(TeleopParameters())).done
