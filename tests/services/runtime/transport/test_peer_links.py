"""A link between two peers that breaks while both keep theirs to the router is restored."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from typing import Any

import pytest
import zenoh
from zenoh.handlers import FifoChannel

from messages.topics import Quality
from services.runtime.graph import Entity
from services.runtime.transport import peer_links
from services.runtime.transport.peer_links import TRIES, PeerLinks
from services.runtime.transport.unix_sockets import is_unix, path_of, router_endpoint
from services.runtime.transport.zenoh import ZenohTransport, open_session
from services.runtime.transport.zenoh_config import configuration
from tests.harness.ports import free_port
from tests.harness.waiting import wait_until

WITHIN_S = 60.0
SHAPES = {"Unix sockets": lambda: router_endpoint(free_port()), "TCP": lambda: f"tcp/127.0.0.1:{free_port()}"}


@pytest.fixture(params=SHAPES)
def router(request: pytest.FixtureRequest) -> Iterator[str]:
    """The endpoint of a router of this process."""
    endpoint = SHAPES[request.param]()
    with ZenohTransport(configuration("router", listen=(endpoint,))):
        yield endpoint


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Try as soon as a link has broken."""
    monkeypatch.setattr(peer_links, "FIRST_S", 0.0)
    monkeypatch.setattr(peer_links, "SECOND_SIDE_S", 0.0)


class Session:
    """A bare session of a peer, which the router knows by a token, and the events of its links."""

    def __init__(self, stack: ExitStack, router: str, known: bool = True) -> None:
        self.tree = peer_tree(router)
        self.zenoh = stack.enter_context(open_session(self.tree))
        self.name = str(self.zenoh.zid())
        self._token = self.zenoh.liveliness().declare_token(token(self.name)) if known else None
        self._events = self.zenoh.info.declare_transport_events_listener(FifoChannel(1000))
        self.opened: list[str] = []
        self.links = PeerLinks(self.zenoh, self.tree, self._open)

    def _open(self, tree: Mapping[str, Any]) -> zenoh.Session:
        self.opened.append(tree["mode"])
        return open_session(tree)

    def linked_to(self, peer: str) -> bool:
        return peer in map(str, self.zenoh.info.peers_zid())

    def has_lost(self, peer: str) -> bool:
        """Whether a link to the peer has broken; each time counts once."""
        while (event := self._events.try_recv()) is not None:
            if event.kind == zenoh.SampleKind.DELETE and str(event.transport.zid) == peer:
                return True
        return False

    def idle(self) -> bool:
        """Work at the broken links; return whether none is left."""
        self.links.update()
        return not (self.links.broken or self.links.trying)


def linked(one: Session, two: Session) -> None:
    wait_until(lambda: one.linked_to(two.name) and two.linked_to(one.name), WITHIN_S, "linked")


def peer_tree(router: str) -> dict[str, Any]:
    """Return the configuration of a peer, on TCP with a known port."""
    return configuration("direct", (router,), () if is_unix(router) else (f"tcp/127.0.0.1:{free_port()}",))


def token(session: str) -> str:
    return Entity(session, "node", "/peer").key


def cut(*peers: Mapping[str, Any]) -> None:
    """Break the links of these peers of this process to other peers, as the end of a lease does."""
    own = {address(each) for tree in peers for each in tree["listen"]["endpoints"]}
    for descriptor in os.listdir("/proc/self/fd"):
        with suppress(OSError):  # one that has been closed meanwhile, or that listens
            if os.readlink(f"/proc/self/fd/{descriptor}").startswith("socket:"):
                with socket.socket(fileno=os.dup(int(descriptor))) as link:
                    if {link.getsockname(), link.getpeername()} & own:
                        link.shutdown(socket.SHUT_RDWR)


def address(endpoint: str) -> str | tuple[str, int]:
    """Return the address of an endpoint as sockets give it."""
    if is_unix(endpoint):
        return str(path_of(endpoint))
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return host, int(port)


def test_messages_flow_again(router: str) -> None:
    with ExitStack() as stack:
        trees = [peer_tree(router) for _ in range(2)]
        one, two = (stack.enter_context(ZenohTransport(tree)) for tree in trees)
        tokens = [each.declare_token(token(each.session)) for each in (one, two)]
        witness = one.watch(token(two.session))
        wait_until(lambda: (event := witness.poll()) and event.alive, WITHIN_S, "the other peer's token")
        subscribers = [each.subscribe("topic", 1000) for each in (one, two)]
        publishers = [each.advertise("topic", "", Quality.SENSOR) for each in (one, two)]

        def exchanged() -> bool:
            for number, each in enumerate(publishers):
                each.put(str(number).encode(), attachment=b"x")
            received = [{sample[0] for sample in iter(each.recv, None)} for each in subscribers]
            return b"1" in received[0] and b"0" in received[1]

        wait_until(exchanged, WITHIN_S, "messages of both")
        cut(*trees)
        wait_until(lambda: (event := witness.poll()) and not event.alive, WITHIN_S, "the end of the link")
        wait_until(lambda: (event := witness.poll()) and event.alive, WITHIN_S, "the token after the link's return")
        wait_until(exchanged, WITHIN_S, "messages of both after the link's return")
        for each in tokens:
            each.close()


def test_the_link_returns(router: str) -> None:
    """One session asks the router, another joins for a moment; the second side, later, finds nothing to do."""
    with ExitStack() as stack:
        one, two = Session(stack, router), Session(stack, router)
        linked(one, two)
        assert one.idle()
        cut(one.tree, two.tree)
        wait_until(lambda: one.has_lost(two.name), WITHIN_S, "the first unlinked")
        wait_until(lambda: two.has_lost(one.name), WITHIN_S, "the second unlinked")
        one.links.restore([two.name])
        assert one.linked_to(two.name)
        assert one.opened == ["client", "peer"]
        wait_until(lambda: two.linked_to(one.name), WITHIN_S, "linked again")
        two.links.restore([one.name])
        assert two.opened == []
        wait_until(lambda: one.idle() and two.idle(), WITHIN_S, "nothing left to do")


def test_what_has_ended_is_let_go(router: str) -> None:
    """On Unix sockets without another session; a peer on TCP is looked for once, at the router."""
    with ExitStack() as stack:
        one, other = Session(stack, router), ExitStack()
        two = Session(other, router)
        linked(one, two)
        other.close()

        def unlinked() -> bool:
            """A closed session may still accept a second link, which only the end of its process closes."""
            cut(two.tree)
            return one.has_lost(two.name)

        wait_until(unlinked, WITHIN_S, "unlinked")
        sessions = [] if is_unix(router) else ["client"]
        wait_until(lambda: one.idle() and len(one.opened) >= len(sessions), WITHIN_S, "nothing left to do")
        assert one.opened == sessions


def test_one_that_the_router_does_not_know(router: str) -> None:
    """It may be frozen, and joins again by itself: the router is asked in each try while its process runs."""
    with ExitStack() as stack:
        one, two = Session(stack, router), Session(stack, router, known=False)
        linked(one, two)
        cut(one.tree, two.tree)
        wait_until(lambda: one.has_lost(two.name), WITHIN_S, "unlinked")
        wait_until(lambda: one.idle() and one.opened, WITHIN_S, "nothing left to do")
        assert one.opened == ["client"] * (TRIES if is_unix(router) else 1)
        assert not one.linked_to(two.name)
