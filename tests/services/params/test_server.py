"""The parameter server in memory: origins, atomic sets, levels, clamps, resets, and relations between parameters."""

from __future__ import annotations

import pytest

from messages.parameters import ParameterDescription, ParameterSchema
from services.runtime.errors import BadInput
from tests.services.params.parameter_client import arm_announcement, assignments, value_dict
from tests.services.params.server_harness import ServerHarness


def test_the_latest_origin_wins(at: ServerHarness) -> None:
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


def test_what_is_set_counts_at_once_even_where_the_command_line_has_a_word(at: ServerHarness) -> None:
    reply = at.set(tr_Kp=6)
    assert at.get()["tr_Kp"] == 6.0
    assert "the command line gives 5.0" in reply.note
    at.server.new_run()
    assert at.get()["tr_Kp"] == 5.0


def test_a_set_is_whole_or_not_at_all_and_names_every_violation(at: ServerHarness) -> None:
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


def test_the_level_is_the_union_of_what_changed(at: ServerHarness) -> None:
    schema, first = at.published
    assert isinstance(schema, ParameterSchema)
    assert first.level == 2**32 - 1
    assert at.set(reference_type="sine", ss_Kp=1, window=2).level == 2 | 4
    assert at.published[-1].level == 2 | 4
    assert [each.revision for each in at.published[1:]] == [1, 2]


def test_clamp_on_request(at: ServerHarness) -> None:
    reply = at.set(clamp=True, ref_angle=400, window=-3)
    assert (value_dict(reply)["ref_angle"], value_dict(reply)["window"]) == (90.0, 1)
    assert "ref_angle = 400.0 was clamped to 90.0" in reply.note


def test_reset_forgets_what_was_set(at: ServerHarness) -> None:
    at.set(ref_angle=10, ss_Kp=2)
    at.set(run=True, window=9)
    assert value_dict(at.reset("ref_angle"))["ref_angle"] == 20.0
    assert at.get()["ss_Kp"] == 2.0
    at.reset()
    assert (at.get()["ss_Kp"], at.get()["window"]) == (37.5, 2)
    assert at.reset().note == "nothing was set"
    with pytest.raises(BadInput, match=r"unknown parameter 'ss_kp'; did you mean 'ss_Kp'"):
        at.reset("ss_kp")


BAND = (
    ParameterDescription(name="slow", default=1.0, at_most="fast"),
    ParameterDescription(name="fast", default=2.0),
    ParameterDescription(name="smooth", type="bool", default=False, excludes=("jerk",)),
    ParameterDescription(name="jerk", optional=True),
    ParameterDescription(name="other", default=0.0),
)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"slow": 3}, "slow = 3.0 is above fast = 2.0, which it may not exceed"),
        ({"fast": 0.5, "other": 1}, "slow = 1.0 is above fast = 0.5"),
        ({"slow": 7, "fast": 6}, "slow = 7.0 is above fast = 6.0"),
        ({"smooth": True, "jerk": 5}, "smooth = True and jerk = 5.0 exclude each other"),
    ],
)
def test_a_set_that_contradicts_itself_is_refused_before_it_counts(
    at: ServerHarness, given: dict[str, float], says: str
) -> None:
    at.server.announce(arm_announcement(parameters=BAND))
    before, told = at.record(), len(at.published)
    with pytest.raises(BadInput, match=f"{says}.*nothing was changed"):
        at.set(**given)
    assert (at.record(), len(at.published), at.history()) == (before, told, [])


def test_together_they_may_pass_each_other_and_null_is_under_no_bound(at: ServerHarness) -> None:
    at.server.announce(arm_announcement(parameters=BAND))
    at.set(slow=8, fast=9)
    with pytest.raises(BadInput, match=r"slow = 8\.0 is above fast = 2\.0"):
        at.reset("fast")
    at.reset()
    assert at.get() == {"slow": 1.0, "fast": 2.0, "smooth": False, "jerk": None, "other": 0.0}
    at.set(jerk=5)
    at.set(smooth=False)
    with pytest.raises(BadInput, match="exclude each other"):
        at.set(smooth=True)
    at.set(jerk=None, smooth=True)


def test_who_contradicts_itself_already_can_still_be_mended(at: ServerHarness) -> None:
    """The fleet file and saved values may contradict each other, without any set being at fault."""
    at.server.announce(arm_announcement(parameters=BAND))
    at.set(slow=1.5)
    at.server.announce(arm_announcement(parameters=BAND, fleet=assignments(fast=1)))
    at.set(other=3)
    with pytest.raises(BadInput, match=r"slow = 1\.7 is above fast = 1\.0"):
        at.set(slow=1.7)
    assert value_dict(at.reset("slow"))["slow"] == 1.0
