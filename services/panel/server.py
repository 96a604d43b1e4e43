"""The web server, in a thread of its own."""

from __future__ import annotations

import asyncio
import errno
import socket
import threading
import time
from collections.abc import Callable
from typing import Self

import uvicorn
from starlette.types import ASGIApp

from services.panel.door import behind
from services.panel.guard import Pass
from services.panel.words import LARGEST
from services.runtime.errors import BadInput

HOST = "127.0.0.1"
TRIES = 20
"""Ports that are tried after the one that was asked for."""
START_S = 10.0
STOP_S = 2.0


def listen(port: int) -> socket.socket:
    """A socket that listens on the loopback, on ``port`` or the next that is free; raises BadInput without any."""
    last = min(port + TRIES - 1, 65535)
    for candidate in range(port, last + 1) if port else (0,):
        made = socket.socket()
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            made.bind((HOST, candidate))
            made.listen(64)
        except OSError as error:
            made.close()
            if error.errno != errno.EADDRINUSE:
                raise BadInput(f"cannot listen on {HOST}:{candidate}: {error.strerror}") from None
        else:
            return made
    raise BadInput(f"the ports {port} to {last} of {HOST} are all taken: choose another with port=N")


class Server:
    """Serves ``app`` on ``listening`` while the context lasts; ``pulse`` is called every ``period()`` seconds there.

    Who has not shown the token of ``gate`` is let in for a few seconds only.
    """

    def __init__(
        self,
        app: ASGIApp,
        gate: Pass,
        listening: socket.socket,
        pulse: Callable[[], None],
        period: Callable[[], float],
    ) -> None:
        self._listening, self._pulse, self._period = listening, pulse, period
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            server_header=False,
            lifespan="off",
            loop="asyncio",
            http=behind(gate),
            ws="websockets-sansio",
            ws_max_size=LARGEST,
            ws_ping_interval=2.0,
            ws_ping_timeout=5.0,
            ws_per_message_deflate=False,
            limit_concurrency=128,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, name="web", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        deadline = time.monotonic() + START_S
        while not self._server.started:
            if time.monotonic() > deadline or not self._thread.is_alive():
                raise BadInput(f"the web server did not start within {START_S:g} s")
            time.sleep(0.01)
        return self

    def __exit__(self, *exception: object) -> None:
        self._server.should_exit = True
        self._thread.join(STOP_S)

    def _serve(self) -> None:
        asyncio.run(self._both())

    async def _both(self) -> None:
        beating = asyncio.create_task(self._beat())
        try:
            await self._server.serve(sockets=[self._listening])
        finally:
            beating.cancel()

    async def _beat(self) -> None:
        """The loop's pace: faster while pages are open, so that it needs none of its own when nobody looks."""
        while True:
            await asyncio.sleep(self._period())
            self._pulse()
