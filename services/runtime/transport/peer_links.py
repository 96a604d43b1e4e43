"""Restores a link between two peers that broke while both kept theirs to the router.

Zenoh links two peers when one of them joins the router, and not again: when their link breaks later, for example
because one stood still for longer than the lease, neither receives a message from the other any more, since a router
forwards nothing between peers. A third peer that joins mends it, for it tells each neighbour the addresses of all
others. So a peer that misses another one joins with a second session for a moment.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import zenoh
from zenoh.handlers import FifoChannel

from services.runtime.transport import unix_sockets
from services.runtime.transport.api import ADMIN_SPACE
from services.runtime.transport.zenoh_config import configuration

FIRST_S = 1.0
"""Wall time [s] after which a link that broke is restored; each further try waits twice as long as the one before."""
SECOND_SIDE_S = 2.0
"""Wall time [s] by which the peer with the smaller id waits longer: one of the two suffices."""
TRIES = 5
"""Tries to restore a link; the last begins half a minute after it broke."""
LINK_S = 5.0
"""Maximum wall time [s] of one try."""
_POLL_S = 0.02
_TOKENS_S = 5.0
"""Wall time [s] for the router to tell the tokens of one session."""
_MOST = 1 << 16
"""Maximum links that come and go between two calls of ``update``, and maximum tokens of one session."""

Open = Callable[[Mapping[str, Any]], zenoh.Session]
"""Opens a session with a configuration."""


class _Broken(NamedTuple):
    """A link to restore: when to try next [s, monotonic], the pause after that try [s], and the tries left."""

    due: float
    pause: float
    tries: int


class PeerLinks:
    """The links of one peer. ``update`` notes those that broke; a thread of its own restores them.

    A process that has ended no longer listens on its Unix socket, and costs nothing more. For one that is frozen, which
    the router has lost as well, the router is asked again in each try.
    """

    def __init__(self, session: zenoh.Session, tree: Mapping[str, Any], open_session: Open) -> None:
        self._session, self._open = session, open_session
        self._name = str(session.zid())
        self._routers = tuple(tree["connect"]["endpoints"])
        self._domain = tree.get("namespace", "")
        own = [unix_sockets.path_of(each) for each in tree["listen"]["endpoints"] if unix_sockets.is_unix(each)]
        self._folder = own[0].parent if own else None
        self._events = session.info.declare_transport_events_listener(FifoChannel(_MOST))
        self.broken: dict[str, _Broken] = {}
        """The links to restore, by the other peer's id."""
        self._closing = threading.Event()
        self._worker: threading.Thread | None = None

    def update(self) -> None:
        """Note the links that broke or came up since the last call, and start to restore those that are due."""
        now = time.monotonic()
        while (event := self._events.try_recv()) is not None:
            if event.transport.whatami == zenoh.WhatAmI.PEER:
                peer = str(event.transport.zid)
                if event.kind == zenoh.SampleKind.DELETE:
                    wait = FIRST_S if self._name > peer else FIRST_S + SECOND_SIDE_S
                    self.broken[peer] = _Broken(now + wait, 2 * FIRST_S, TRIES)
                else:
                    self.broken.pop(peer, None)
        if self.trying:
            return
        due = [peer for peer, link in self.broken.items() if link.due <= now]
        for peer in due:
            _, pause, tries = self.broken.pop(peer)
            if tries > 1:
                self.broken[peer] = _Broken(now + pause, 2 * pause, tries - 1)
        if due:
            self._worker = threading.Thread(target=self._try, args=(due,), name="peer_links", daemon=True)
            self._worker.start()

    @property
    def trying(self) -> bool:
        """Whether a try is under way."""
        return self._worker is not None and self._worker.is_alive()

    def close(self, seconds: float) -> None:
        """End a try that is under way; wait for it, ``seconds`` at most. ``update`` must not be called any more."""
        self._closing.set()
        if self._worker is not None:
            self._worker.join(seconds)

    def _try(self, peers: list[str]) -> None:
        running = [peer for peer in peers if self._may_run(peer)]
        for peer in set(peers) - set(running):
            self.broken.pop(peer, None)
        with suppress(zenoh.ZError):  # the router is being restarted, or this session closed
            self.restore(running)

    def restore(self, peers: list[str]) -> None:
        """Restore the links to those of ``peers`` that are linked to the router, within LINK_S.

        Raises zenoh.ZError if the router cannot be joined.
        """
        missing = set(peers) - self._linked()
        if not missing or not self._session.info.routers_zid():
            return
        found = self._at_router(missing)
        if self._folder is None:
            for peer in missing - found:
                self.broken.pop(peer, None)
        if found:
            with self._open(configuration("direct", self._routers, domain=self._domain)):
                end = time.monotonic() + LINK_S
                while not found <= self._linked() and time.monotonic() < end and not self._closing.wait(_POLL_S):
                    pass

    def _linked(self) -> set[str]:
        return {str(each) for each in self._session.info.peers_zid()}

    def _may_run(self, peer: str) -> bool:
        """Whether the peer's process may still run; always, if it is not reached by a Unix socket."""
        return self._folder is None or unix_sockets.is_held(unix_sockets.node_socket(self._folder, peer))

    def _at_router(self, peers: set[str]) -> set[str]:
        """Return the peers of which the router knows a token; it tells these only to its clients."""
        with self._open(configuration("star", self._routers, domain=self._domain)) as client:
            return {peer for peer in peers if self._has_token(client, peer)}

    def _has_token(self, client: zenoh.Session, peer: str) -> bool:
        replies = client.liveliness().get(f"{ADMIN_SPACE}/{peer}/**", FifoChannel(_MOST), timeout=_TOKENS_S)
        return any(reply.ok is not None for reply in replies)
