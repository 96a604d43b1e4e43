"""Name claims on a real network, and the nodes that a new node has discovered by then."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from pathlib import Path

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
            start.wait(20)
            try:
                with node(mine, "same"):
                    got.append(mine.session)
                    decided.wait(20)
            except TryAgain as error:
                refused.append(str(error))
                decided.wait(20)

    threads = [threading.Thread(target=come) for _ in range(3)]
    for each in threads:
        each.start()
    for each in threads:
        each.join(30)
    assert len(got) == 1
    assert len(refused) == 2
    assert all("a node /same is already there" in each for each in refused)


def test_what_else_answers_for_the_register_is_not_believed(network: Network) -> None:
    with transport(network) as asked, transport(network) as stranger:
        assert known_nodes(asked) is not None
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


def test_a_node_that_may_be_replaced_is_told_so_and_makes_room(
    network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    with transport(network) as first, transport(network) as second, ExitStack() as stack:
        old, new = node(first, "talker"), node(second, "talker")
        old.on_asked_to_end, old.replaceable, new.replaceable = asked.append, True, True
        entered = stack.enter_context(old)
        taken = threading.Thread(target=lambda: stack.enter_context(new))
        taken.start()
        while taken.is_alive():
            entered.spin_once()
            taken.join(0.01)
        assert asked == [REPLACED]
        assert {each.session for each in snapshot(second) if each.node == "/talker"} >= {second.session}
        monkeypatch.setattr(name_claim, "TAKEOVER_S", 0.1)  # no node gives way
        with transport(network) as third, pytest.raises(TryAgain, match="already there"), node(third, "talker"):
            pass  # a node of another kind is rejected as before
