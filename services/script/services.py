"""Services of a script, in ROS's sense: each served by its own threads, called from any thread."""

from __future__ import annotations

import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from messages.base import encode
from messages.requests import Refusal
from services.runtime.requests import refusal_reason
from services.runtime.transport.api import TIMEOUT, QueryServer, Reply
from services.runtime.transport.request_queue import Refusals
from services.script.api import ServiceRefused, ServiceUnavailable
from services.script.threads import Threads, Worker

FOREVER_S = 86400.0
"""Wall time [s] that a call without a timeout waits; in ROS it waits indefinitely."""
MAX_EXTRA_THREADS = 100
"""Maximum number of further threads of a service, for calls that arrive while its handler is busy."""


class Owner(Protocol):
    """A service's interface to the kernel that owns it."""

    threads: Threads
    lockstep: bool

    def close_server(self, server: ServiceServer) -> None:
        """Close a service."""
        ...


class ServiceServer:
    """A service that a script serves: by one thread, and by further ones while the handler is busy, as in ROS, where
    each call has its own.
    """

    def __init__(self, name: str, ros_type: str, handle: Callable[[bytes], bytes], owner: Owner) -> None:
        self.name, self.ros_type = name, ros_type
        self._handle, self._owner = handle, owner
        self._requests: deque[tuple[bytes, Callable[[bytes], None], Callable[[bytes], None]]] = deque()
        self._lock = threading.Lock()
        self._busy: set[int] = set()
        """The threads in the handler."""
        self._extra_threads = 0
        """The number of further threads."""
        self._closing: int | None = None
        """The thread in the handler that closes the service after its answer."""
        self._open = True
        self.queries: QueryServer | None = None
        self.refusals = Refusals()
        self.worker: Worker = owner.threads.worker(name, self._work)

    def poll(self) -> None:
        """Read the queries received, in the node's thread."""
        while self.queries is not None and (query := self.queries.recv()) is not None:
            if query.key != self.name[1:]:
                reason = f"sent to {query.key[:80]!r}: a request names one service, here {self.name}, without wildcards"
                query.refuse(encode(Refusal(reason=reason)))
                continue
            self.put(query.payload, query.reply, query.refuse)

    def put(self, payload: bytes, reply: Callable[[bytes], None], refuse: Callable[[bytes], None]) -> None:
        """Queue a request, with the functions that answer and refuse it."""
        with self._lock:
            is_open, busy = self._open, bool(self._busy)
            if is_open:
                self._requests.append((payload, reply, refuse))
        if not is_open:
            refuse(self._shut_down())
        elif busy:
            self._start_extra_thread()
        else:
            self.worker.notify()

    def close(self) -> None:
        """Stop serving; calls that wait for the handler are refused.

        In lockstep, a handler that closes its own service does so with its answer, which could not be sent afterwards.
        """
        with self._lock:
            if self._owner.lockstep and threading.get_ident() in self._busy:
                self._closing = threading.get_ident()
                return
            self._open = False
            waiting = list(self._requests)
            self._requests.clear()
        for _, _, refuse in waiting:
            refuse(self._shut_down())
        self._owner.close_server(self)
        self.worker.close()

    def _shut_down(self) -> bytes:
        return encode(Refusal(reason=f"service [{self.name}] has been shut down"))

    def _start_extra_thread(self) -> None:
        """Start a further thread for the waiting requests."""
        with self._lock:
            if self._extra_threads == MAX_EXTRA_THREADS:
                return
            self._extra_threads += 1
        self._owner.threads.spawn(self._run_extra_thread, self.name)

    def _run_extra_thread(self) -> None:
        try:
            while self._work():
                pass
        finally:
            with self._lock:
                self._extra_threads -= 1

    def _work(self) -> bool:
        """Answer the oldest request; return False if none waits."""
        me = threading.get_ident()
        with self._lock:
            if not self._requests:
                return False
            payload, reply, refuse = self._requests.popleft()
            more = bool(self._requests)
            self._busy.add(me)
        if more:
            self._start_extra_thread()
        try:
            self._answer(payload, reply, refuse)
        finally:
            with self._lock:
                self._busy.discard(me)
        if self._closing == me:
            self._closing = None
            self.close()
        return True

    def _answer(self, payload: bytes, reply: Callable[[bytes], None], refuse: Callable[[bytes], None]) -> None:
        try:
            answer = self._handle(payload)
        except ServiceRefused as error:
            refuse(encode(Refusal(reason=str(error))))
        except SystemExit:  # in ROS it ends the thread of this call alone
            refuse(encode(Refusal(reason="the handler ended without a response (SystemExit)")))
        except Exception as error:  # noqa: BLE001 - the caller gets the reason, and the node goes on
            traceback.print_exc()
            refuse(encode(Refusal(reason=f"error processing request: {error}")))
        else:
            reply(answer)


def read_answer(name: str, replies: Sequence[Reply]) -> bytes:
    """Return the payload of the single answer; raises ServiceUnavailable, ServiceRefused."""
    answers = [each for each in replies if each.payload != TIMEOUT or each.ok]
    for each in answers:
        if each.ok:
            return each.payload
    if not answers:
        late = ": it did not answer in time" if replies else ""
        raise ServiceUnavailable(f"service [{name}] unavailable{late}")
    raise ServiceRefused(refusal_reason(answers[0].payload))
