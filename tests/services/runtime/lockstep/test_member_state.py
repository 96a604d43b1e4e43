"""The simulation's record of a member: whose numbers it may report, and how far they may go."""

from __future__ import annotations

import pytest

from messages.topics import Quality
from services.runtime.lockstep.member_state import MemberState
from services.runtime.lockstep.protocol import StepReport
from services.runtime.lockstep.watermarks import MAX_JUMP
from services.runtime.step import STEP_NS
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import member_id, publisher_id

SESSION = "feed"
OF_A, OF_B, OF_STRANGER = (publisher_id(node, SESSION, "x") for node in ("/a", "/b", "/stranger"))


@pytest.fixture
def member() -> MemberState:
    ids = {node: member_id(node, SESSION) for node in ("/a", "/b")}
    member = MemberState(ids, SESSION, MemoryTransport(MemoryBus()).advertise("go", "", Quality.EVENT), b"token")
    joined = StepReport(
        session=SESSION, tick=0, answers_join=True, period=STEP_NS, announced={"x": {OF_A: 5 * MAX_JUMP}}
    )
    assert not member.account(joined), "it may have published any number before it joined"
    return member


def report(numbers: dict[bytes, int], announced: dict[bytes, int] | None = None) -> StepReport:
    return StepReport(session=SESSION, tick=1, sequence_numbers={"x": numbers}, announced={"x": announced or {}})


def test_numbers_go_on_from_the_last_reported_ones(member: MemberState) -> None:
    assert not member.account(report({OF_A: 5 * MAX_JUMP + 1}, {OF_B: 3}))
    assert not member.account(report({OF_A: 6 * MAX_JUMP + 1, OF_B: 3}))
    assert member.sent == {OF_A: 6 * MAX_JUMP + 1, OF_B: 3}
    for numbers, last in (({OF_A: 6 * MAX_JUMP}, 6 * MAX_JUMP + 1), ({OF_B: 4 + MAX_JUMP}, 3)):
        for given in (report({OF_B: 4} | numbers), report({OF_B: 4}, numbers)):
            assert member.account(given).endswith(f"of a publisher after {last}")
    assert member.sent == {OF_A: 6 * MAX_JUMP + 1, OF_B: 3}, "a refused report leaves nothing"


def test_numbers_of_others_are_refused(member: MemberState) -> None:
    for given in (report({OF_B: 1, OF_STRANGER: 1}), report({OF_B: 1}, {OF_STRANGER: 1})):
        assert member.account(given) == "/a, /b reports the numbers of another node's publisher"
    assert member.sent == {OF_A: 5 * MAX_JUMP}


def test_a_node_that_has_ended_reports_nothing_more(member: MemberState) -> None:
    assert not member.account(report({OF_A: 5 * MAX_JUMP + 1, OF_B: 1}))
    member.release(["/a"])
    assert member.account(report({OF_A: 5 * MAX_JUMP + 2})) == "/b reports the numbers of another node's publisher"
    assert not member.account(report({OF_B: 2}))
    assert member.sent == {OF_B: 2}
