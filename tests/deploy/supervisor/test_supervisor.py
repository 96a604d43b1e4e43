"""The supervisor with real processes: start order, published state, requests and logs."""

from __future__ import annotations

from pathlib import Path

from deploy.supervisor.supervisor import Supervisor
from tests.deploy.supervisor.supervisor_harness import SupervisorHarness, faulty_process, wait_all_ready, wait_until
from tests.harness import waiting


def test_starts_in_order_of_readiness_and_stops_in_reverse(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    first, second = faulty_process("good", "/first"), faulty_process("good", "/second", depends_on=("first",))
    third = faulty_process("good", "/third", depends_on=("first", "second"))
    outcome = harness.run(wait_all_ready, third, second, first)
    order = [(name, state) for _, name, state in harness.state_changes if state in ("starting", "ready", "stopped")]
    assert order == [
        *[(name, state) for name in ("first", "second", "third") for state in ("starting", "ready")],
        *[(name, "stopped") for name in ("third", "second", "first")],
    ]
    assert outcome.ended == "interrupted"
    assert outcome.restarts == 0


def test_publishes_its_state_with_each_change(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    harness.run(wait_all_ready, faulty_process("good", "/a"))
    told = [state.processes[0].state for state in harness.bus.published]
    assert told == harness.states("a") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert harness.bus.published[2].processes[0].pid > 0
    assert harness.bus.published[-1].processes[0].pid == 0


def test_orders(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    answers = harness.bus.answers

    async def order(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        life = supervisor.processes["tb3_0/a"]
        first = life.state_message().pid
        harness.bus.requests += [("start", "/tb3_0/a"), ("restart", "tb3_0/a"), ("restart", "tb3_0/aa")]
        await wait_until(lambda: len(answers) == 3 and life.state == "ready" and life.state_message().pid != first)
        harness.bus.requests.append(("stop", "tb3_0/a"))
        await wait_until(lambda: life.state == "stopped")
        harness.bus.requests += [("stop", "tb3_0/a"), ("start", "tb3_0/a")]
        await wait_until(lambda: life.state == "ready")

    outcome = harness.run(order, faulty_process("good", "/tb3_0/a"))
    assert answers == [
        "refused: /tb3_0/a is already running (ready)",
        "tb3_0/a restarts",
        "refused: unknown process 'tb3_0/aa'; did you mean 'tb3_0/a'? (known: tb3_0/a)",
        "tb3_0/a stops",
        "refused: tb3_0/a is not running (stopped)",
        "tb3_0/a starts",
    ]
    assert outcome.restarts == 0


def test_log_is_bounded_and_never_blocks_its_process(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    lines = 100_000
    harness.run(wait_all_ready, faulty_process("talker", "/a", str(lines)))
    logs = [tmp_path / "logs" / name for name in ("a.log", "a.log.1")]

    def sizes() -> list[int]:
        return [each.stat().st_size for each in logs]

    # A thread writes the log; its supervisor does not wait long for it at the end.
    waiting.wait_until(lambda: sum(sizes()) >= lines * 100, what="the whole log")
    assert max(sizes()) <= 8 << 20
