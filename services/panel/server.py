"""The web server in its own thread, its routes, and the WebSockets of pages."""

from __future__ import annotations

import asyncio
import errno
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from services.panel.auth import Authenticator, AuthMiddleware, guarded_protocol
from services.panel.pages import Page, PageRegistry, send_error
from services.panel.protocol import MAX_MESSAGE_SIZE, decode_message
from services.runtime.errors import BadInput

HOST = "127.0.0.1"
PORT_TRIES = 20
"""Number of ports to try, beginning with the requested one."""
START_TIMEOUT_S = 10.0
STOP_TIMEOUT_S = 2.0


def listen(port: int, earlier: int | None = None) -> socket.socket:
    """Return a socket that listens on the loopback interface, on ``port`` or the next free one; raises BadInput if none
    is free.

    The port used before a restart (``earlier``) is preferred if it is among these: open pages reconnect there.
    """
    last = min(port + PORT_TRIES - 1, 65535)
    ports = range(port, last + 1) if port else range(1)
    for candidate in sorted(ports, key=lambda each: each != earlier):
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
    """Serves ``app`` on ``listening`` in a thread, which also calls ``wake`` every ``period()`` seconds.

    Connections without the token of ``auth`` are closed after AUTH_TIMEOUT_S.
    """

    def __init__(
        self,
        app: ASGIApp,
        auth: Authenticator,
        listening: socket.socket,
        wake: Callable[[], None],
        period: Callable[[], float],
    ) -> None:
        self._listening, self._wake, self._period = listening, wake, period
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            server_header=False,
            lifespan="off",
            loop="asyncio",
            http=guarded_protocol(auth),
            ws=PageProtocol,
            ws_max_size=MAX_MESSAGE_SIZE,
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
        deadline = time.monotonic() + START_TIMEOUT_S
        while not self._server.started:
            if time.monotonic() > deadline or not self._thread.is_alive():
                raise BadInput(f"the web server did not start within {START_TIMEOUT_S:g} s")
            time.sleep(0.01)
        return self

    def __exit__(self, *exception: object) -> None:
        self._server.should_exit = True
        self._thread.join(STOP_TIMEOUT_S)

    def _serve(self) -> None:
        asyncio.run(self._run())

    async def _run(self) -> None:
        ticker = asyncio.create_task(self._wake_periodically())
        try:
            await self._server.serve(sockets=[self._listening])
        finally:
            ticker.cancel()

    async def _wake_periodically(self) -> None:
        """Wake the loop at its period: often while pages are open, rarely without any."""
        while True:
            await asyncio.sleep(self._period())
            self._wake()


class PageProtocol(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, which passes on text that is not UTF-8 as bytes, to be refused and counted.

    uvicorn itself would log a traceback and close the connection.
    """

    def send_receive_event_to_app(self) -> None:
        if self.curr_msg_data_type == "text":
            try:
                b"".join(self.frames).decode()
            except UnicodeDecodeError:
                self.curr_msg_data_type = "bytes"
        super().send_receive_event_to_app()


STATIC = Path(__file__).with_name("static")
MAX_MESSAGES_PER_S = 200
"""Maximum message rate of a page [Hz]; driving takes 20."""
MAX_REJECTED = 50
"""Maximum refused messages of a page; a further one closes it."""


def create_app(auth: Authenticator, pages: PageRegistry) -> Starlette:
    """Create the application: its routes behind AuthMiddleware."""

    async def home(request: Request) -> Response:
        if auth.query_is_valid(request.scope) or auth.redeem_ticket(request.query_params.get("once", "")):
            # Redirect, so that neither stays in the browser's history or address bar.
            response = RedirectResponse("/", 303)
            response.set_cookie(auth.cookie, auth.token, httponly=True, samesite="strict", path="/")
            return response
        if auth.cookie_is_valid(request.headers):
            return FileResponse(STATIC / "index.html")
        return FileResponse(STATIC / "locked.html", status_code=401)

    async def session(request: Request) -> Response:
        """Report whether the token is still valid: browsers hide from a page why its socket was refused."""
        known = auth.cookie_is_valid(request.headers)
        return PlainTextResponse("known" if known else "unknown", 200 if known else 401)

    async def ticket(request: Request) -> Response:
        """Issue a ticket for ``./elea panel``, which may show it on a browser's command line."""
        known = auth.cookie_is_valid(request.headers)
        return PlainTextResponse(auth.issue_ticket() if known else "unknown", 200 if known else 401)

    async def socket(ws: WebSocket) -> None:
        await handle_socket(ws, pages)

    return Starlette(
        routes=[
            Route("/", home),
            Route("/session", session),
            Route("/ticket", ticket, methods=["POST"]),
            WebSocketRoute("/socket", socket),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        middleware=[Middleware(AuthMiddleware, auth=auth)],
    )


async def handle_socket(ws: WebSocket, pages: PageRegistry) -> None:
    """Serve one page until it disconnects."""
    loop, wakened = asyncio.get_running_loop(), asyncio.Event()
    try:
        await ws.accept()
    except OSError:
        return  # it disconnected before it was registered as a page
    page = pages.open_page(_waker(loop, wakened))
    if page is None:
        await ws.close(1013, "too many pages are open")
        return
    sender = asyncio.create_task(_send(ws, page, wakened))
    pace = RateLimit()
    try:
        while True:
            message = await ws.receive()
            if message["type"] == "websocket.disconnect":
                return
            try:
                text = message.get("text")
                if text is None:
                    raise BadInput("messages must be UTF-8 text")
                if not pace.allows(loop.time()):
                    raise BadInput(f"more than {MAX_MESSAGES_PER_S} messages a second")
                decoded = decode_message(text)
                if not pages.submit(page, decoded):
                    raise BadInput("too many messages are queued")
            except BadInput as error:
                pages.reject(page)
                send_error(page, str(error))
                if page.rejected > MAX_REJECTED:
                    await ws.close(1008, "too many invalid messages")
                    return
    except WebSocketDisconnect:
        return
    finally:
        pages.close_page(page)
        sender.cancel()


class RateLimit:
    """Limits a page to MAX_MESSAGES_PER_S, in windows of a second that begin with a message."""

    def __init__(self) -> None:
        self._since, self._count = 0.0, 0

    def allows(self, now: float) -> bool:
        """Count a message at ``now`` [s]; returns whether it is accepted."""
        if now - self._since > 1.0:
            self._since, self._count = now, 0
        self._count += 1
        return self._count <= MAX_MESSAGES_PER_S


def _waker(loop: asyncio.AbstractEventLoop, wakened: asyncio.Event) -> Callable[[], None]:
    def wake() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(wakened.set)

    return wake


async def _send(ws: WebSocket, page: Page, wakened: asyncio.Event) -> None:
    """Send the queued messages, no faster than the page receives them."""
    try:
        while True:
            await wakened.wait()
            wakened.clear()
            for payload in page.drain():
                await (ws.send_text(payload) if isinstance(payload, str) else ws.send_bytes(payload))
    except (WebSocketDisconnect, RuntimeError, OSError):
        return  # the receiving task notices it too
