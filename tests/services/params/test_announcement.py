"""Announcements to the parameter server: nodes that join, return, leave, and change their schema."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from messages.parameters import Announcement, ParameterDescription, ParameterSchema
from messages.std import Empty
from services.runtime.errors import BadInput
from tests.services.params.parameter_client import ARM_PARAMETERS, arm_announcement, assignments, value_dict
from tests.services.params.server_harness import SET, ServerHarness, server_harness


def test_who_comes_back_gets_what_counts_now(at: ServerHarness) -> None:
    at.set(run=True, ref_angle=11)
    told = len(at.published)
    again = at.server.announce(arm_announcement(fleet=assignments(ref_angle=20), command_line=assignments(tr_Kp=5)))
    assert value_dict(again)["ref_angle"] == 11.0
    assert len(at.published) == told


def test_a_node_that_has_gone_has_no_say(at: ServerHarness) -> None:
    new = (replace(ARM_PARAMETERS[1], high=45.0),)
    with pytest.raises(BadInput, match="describe /robot_control ref_angle differently"):
        at.server.announce(arm_announcement(node="/other", parameters=new))
    at.alive.clear()
    assert value_dict(at.server.announce(arm_announcement(node="/other", parameters=new))) == {"ref_angle": 30.0}
    assert "/arm is gone" in at.log.getvalue()


def test_who_leaves_is_followed_by_nobody_and_begins_anew_when_it_returns(at: ServerHarness) -> None:
    """Like a robot that is deleted and spawned again under its name."""
    at.set(ss_Kp=2)
    at.set(run=True, ref_angle=11)
    at.server.announce(Announcement(set=SET, node="/arm", leaves=True))
    schema = next(each for each in reversed(at.published) if isinstance(each, ParameterSchema))
    assert (schema.nodes, schema.parameters) == ((), ())
    assert [each.nodes for each in at.server.list(Empty()).sets] == [()]
    with pytest.raises(BadInput, match="no running service has announced /robot_control"):
        at.set(ref_angle=5)
    told = len(at.published)
    again = at.server.announce(arm_announcement())
    assert (value_dict(again)["ref_angle"], value_dict(again)["ss_Kp"]) == (30.0, 2.0), "saved stays, the run's is gone"
    assert [type(each).__name__ for each in at.published[told:]] == ["ParameterSchema", "ParameterValues"]
    assert at.published[-1].revision > at.published[told - 1].revision
    at.server.announce(Announcement(set=SET, node="/stranger", leaves=True))
    assert at.server.list(Empty()).sets[0].nodes == ("/arm",)


def test_sets_of_robots_that_come_and_go_do_not_fill_the_service(at: ServerHarness) -> None:
    for index in range(1010):
        name = f"/robot{index}/base"
        at.server.announce(arm_announcement(name, node="/sim"))
        at.server.announce(Announcement(set=name, node="/sim", leaves=True))
    assert [each.set for each in at.server.list(Empty()).sets] == [SET]


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
    with server_harness(file) as at:
        at.server.announce(arm_announcement(parameters=OLD))
        at.set(gain=7, speed=4, kind="b", old_name=3, count=2)
    with server_harness(file) as at:
        answer = at.server.announce(arm_announcement(parameters=NEW))
        expected = {"gain": 7.0, "speed": 1.0, "kind": "a", "new_name": 1.0, "count": 2}
        assert repr(value_dict(answer)) == repr(expected)
        for text in (answer.note, at.published[-1].note, at.log.getvalue()):
            assert "saved gain = 7 became 7.0: its type is float now" in text
            assert "saved speed = 4.0 was dropped: speed = 4.0 is out of bounds: 0 to 2" in text
            assert "saved kind = 'b' was dropped: kind = 'b': expected one of a, c" in text
            assert "old_name = 3.0 is saved, but no running node has such a parameter" in text
            assert "was it renamed to new_name? then set that" in text
            assert "saved count = 2.0 became 2: its type is int now" in text
        newest = at.history()[0]
        assert newest.kind == "migrated"
        assert {each.name for each in newest.before} == {"gain", "speed", "kind", "count"}
    with server_harness(file) as at:
        assert "old_name" in at.server.announce(arm_announcement(parameters=NEW)).note
        at.reset("old_name")
    with server_harness(file) as at:
        assert at.server.announce(arm_announcement(parameters=NEW)).note == ""


def test_a_saved_choice_that_was_renamed_gets_its_new_name_and_so_does_what_an_undo_brings_back(tmp_path: Path) -> None:
    old = (ParameterDescription(name="law", type="str", default="default", choices=("default", "seed")),)
    new = (replace(old[0], choices=("default", "tutorial")),)
    file = str(tmp_path / "params.db")
    with server_harness(file) as at:
        at.server.announce(arm_announcement(parameters=old))
        at.set(law="seed")
    with server_harness(file) as at:
        answer = at.server.announce(arm_announcement(parameters=new))
        assert value_dict(answer) == {"law": "tutorial"}
        assert "saved law = 'seed' became 'tutorial': the choice was renamed" in answer.note
        assert at.history()[0].kind == "migrated"
        with pytest.raises(BadInput, match="law = 'seed': it is called 'tutorial' now"):
            at.set(law="seed")
        at.set(law="default")
        at.undo()
        assert at.get() == {"law": "tutorial"}
    with server_harness(file) as at:
        at.server.announce(arm_announcement(parameters=old))
        at.set(law="seed")
        at.reset()
    with server_harness(file) as at:
        at.server.announce(arm_announcement(parameters=new))
        at.undo()
        assert at.get() == {"law": "tutorial"}


def test_a_parameter_that_gets_its_old_name_back_has_its_saved_value(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    for parameters in (OLD, NEW, OLD):
        with server_harness(file) as at:
            at.server.announce(arm_announcement(parameters=parameters))
            if parameters is OLD and not at.history():
                at.set(old_name=3)
    with server_harness(file) as at:
        assert value_dict(at.server.announce(arm_announcement(parameters=OLD)))["old_name"] == 3.0


def test_an_undo_cannot_bring_back_what_fits_no_longer(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with server_harness(file) as at:
        at.server.announce(arm_announcement(parameters=OLD))
        at.set(speed=4)
        at.reset()
    with server_harness(file) as at:
        at.server.announce(arm_announcement(parameters=NEW))
        with pytest.raises(BadInput, match=r"cannot be undone, its schema has changed: speed = 4\.0"):
            at.undo()
        assert at.get()["speed"] == 1.0


def test_values_wait_for_a_node_that_is_late(tmp_path: Path) -> None:
    file = str(tmp_path / "params.db")
    with server_harness(file) as at:
        at.server.announce(arm_announcement(node="/arm", parameters=ARM_PARAMETERS[2:]))
        at.server.announce(arm_announcement(node="/reference", parameters=ARM_PARAMETERS[:2]))
        at.set(ref_angle=10, ss_Kp=2)
    with server_harness(file) as at:
        answer = at.server.announce(arm_announcement(node="/arm", parameters=ARM_PARAMETERS[2:]))
        assert "ref_angle = 10.0 is saved, but no running node has such a parameter: it is kept" in answer.note
        assert at.history()[0].kind != "migrated"
        assert "WARN" not in at.log.getvalue()
        assert (
            value_dict(at.server.announce(arm_announcement(node="/reference", parameters=ARM_PARAMETERS[:2])))[
                "ref_angle"
            ]
            == 10.0
        )
