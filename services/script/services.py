"""Services of a script, in ROS's sense: each served by its own worker thread, called from any thread."""

from __future__ import annotations

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


class Owner(Protocol):
    """A service's interface to the kernel that owns it."""

    threads: Threads

    def close_server(self, server: ServiceServer) -> None:
        """Close a service."""
        ...


class ServiceServer:
    """A service that a script serves."""

    def __init__(self, name: str, ros_type: str, handle: Callable[[bytes], bytes], owner: Owner) -> None:
        self.name, self.ros_type = name, ros_type
        self._handle, self._owner = handle, owner
        self._requests: deque[tuple[bytes, Callable[[bytes], None], Callable[[bytes], None]]] = deque()
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
        self._requests.append((payload, reply, refuse))
        self.worker.notify()

    def close(self) -> None:
        self._owner.close_server(self)
        self.worker.close()

    def _work(self) -> bool:
        if not self._requests:
            return False
        payload, reply, refuse = self._requests.popleft()
        try:
            answer = self._handle(payload)
        except ServiceRefused as error:
            refuse(encode(Refusal(reason=str(error))))
        except Exception as error:  # noqa: BLE001 - the caller gets the reason, and the node goes on
            traceback.print_exc()
            refuse(encode(Refusal(reason=f"error processing request: {error}")))
        else:
            reply(answer)
        return True


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
