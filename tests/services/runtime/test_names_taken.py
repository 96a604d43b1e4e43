"""Name claims on a real network, and the nodes that a new node has discovered by then."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from messages.names import Identity
from services.runtime import name_claim
from services.runtime.discovery import DIRECTORY_KEY, known_nodes
from services.runtime.errors import TryAgain
from services.runtime.graph import REPLACED, snapshot
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, configuration
from tests.harness.processes import Network
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits


def transport(network: Network, role: Role = "direct", settle_s: float = 0.7) -> ZenohTransport:
    return ZenohTransport(configuration(role, (network.endpoint,)), settle_s)


def node(transport: ZenohTransport, name: str) -> Node:
    return Node(transport, Identity.of(name), "tester", Log(name))


@pytest.mark.parametrize("role", ["direct", "star"])
def test_a_newcomer_has_its_name_as_soon_as_it_sees_everybody(network: Network, role: Role) -> None:
    """It would wait for a minute if it couldn't tell."""
    with ExitStack() as stack:
        names = [f"there_{number}" for number in range(6)]
        for name in names:
            stack.enter_context(node(stack.enter_context(transport(network, role)), name))
        with transport(network, role, settle_s=60.0) as newcomer, node(newcomer, "newcomer"):
            seen = {each.node for each in snapshot(newcomer) if each.kind == "node"}
    assert seen == {"/router", "/newcomer", *(f"/{name}" for name in names)}


def test_of_those_that_come_at_once_one_gets_the_name(network: Network, tmp_path: Path) -> None:
    got: list[str] = []
    refused: list[str] = []
    start, decided = threading.Barrier(3), threading.Barrier(3)

    def come() -> None:
        with transport(network) as mine:
            kept = mine.declare_token(f"@elea/come/{mine.session}")
            wait_until(lambda: len(mine.tokens("@elea/come/*")) == 3, what="links to the others")
            start.wait(60)
            kept.close()
            try:
                with node(mine, "same"):
                    got.append(mine.session)
                    decided.wait(60)
            except TryAgain as error:
                refused.append(str(error))
                decided.wait(60)

    threads = [threading.Thread(target=come) for _ in range(3)]
    for each in threads:
        each.start()
    for each in threads:
        each.join(120)
    assert len(got) == 1
    assert len(refused) == 2
    assert all("a node /same is already there" in each for each in refused)


def test_what_else_answers_for_the_register_is_not_believed(network: Network) -> None:
    with transport(network) as asked, transport(network) as stranger:
        wait_until(lambda: known_nodes(asked) is not None, what="an answer of the router")
        server = stranger.serve(DIRECTORY_KEY)
        stop = threading.Event()

        def lie() -> None:
            while not stop.is_set():
                if (query := server.recv()) is not None:
                    query.reply(b"\xc1")
                stop.wait(0.001)

        liar = threading.Thread(target=lie)
        liar.start()
        try:
            for _ in range(5):
                told = known_nodes(asked)
                assert told is None or any("/node/%router/" in each for each in told)
        finally:
            stop.set()
            liar.join()


@contextmanager
def successor(network: Network, reasons: list[str]) -> Iterator[tuple[Node, threading.Thread, ZenohTransport]]:
    """Run a node that may be replaced, and one of its name in a thread, which asks it to end for ``reasons``; yield the
    first node, the thread, and the transport of the second.
    """
    with transport(network) as first, transport(network) as second, ExitStack() as stack:
        old, new = node(first, "talker"), node(second, "talker")
        old.on_asked_to_end, old.replaceable, new.replaceable = reasons.append, True, True
        stack.enter_context(old)
        wait_until(
            lambda: any(each.kind == "pub" and each.node == "/talker" for each in snapshot(second)), what="the old one"
        )
        taken = threading.Thread(target=lambda: stack.enter_context(new))
        taken.start()
        yield old, taken, second


def test_a_node_that_is_too_busy_to_answer_is_asked_again(network: Network, monkeypatch: pytest.MonkeyPatch) -> None:
    asks: list[bool | None] = []
    reasons: list[str] = []
    ask = name_claim.ask_to_end

    def counted(*arguments: Any) -> bool | None:
        asks.append(ask(*arguments))
        return asks[-1]

    monkeypatch.setattr(name_claim, "ask_to_end", counted)
    monkeypatch.setattr(name_claim, "ASK_S", 0.05)
    monkeypatch.setattr(name_claim, "TAKEOVER_S", 600.0)
    with successor(network, reasons) as (old, taken, _):
        wait_until(lambda: asks.count(None) >= 2, what="two questions without an answer")
        monkeypatch.setattr(name_claim, "ASK_S", 60.0)
        while taken.is_alive():
            old.spin_once()
            if asks[-1] is not None:
                monkeypatch.setattr(name_claim, "TAKEOVER_S", 0.0)
            taken.join(0.01)
    assert asks[-1] is True
    assert set(reasons) == {REPLACED}


def test_a_node_that_may_be_replaced_is_told_so_and_makes_room(
    network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(name_claim, "ASK_S", 60.0)  # the old one answers in this thread, whenever that runs
    with successor(network, asked) as (old, taken, second):
        while taken.is_alive():
            old.spin_once()
            taken.join(0.01)
        assert asked == [REPLACED]
        assert {each.session for each in snapshot(second) if each.node == "/talker"} >= {second.session}
        monkeypatch.setattr(name_claim, "TAKEOVER_S", 0.1)  # no node gives way
        # It would wait for a minute if it didn't see the others.
        with (
            transport(network, settle_s=60.0) as third,
            pytest.raises(TryAgain, match="already there"),
            node(third, "talker"),
        ):
            pass  # a node of another kind is rejected as before
