"""The page and its socket, as a web application."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from services.panel.answers import tell_error
from services.panel.board import Board
from services.panel.guard import Guard, Pass
from services.panel.page import Page
from services.panel.words import understand
from services.runtime.errors import BadInput

STATIC = Path(__file__).with_name("static")
WORDS_A_SECOND = 200
"""Of a page; a hand on the stick says 20."""
MOST_REFUSED = 50
"""Senseless words after which a page is closed."""


def application(gate: Pass, board: Board) -> Starlette:
    """The routes behind the guard."""

    async def home(request: Request) -> Response:
        if gate.by_query(request.scope) or gate.redeem(request.query_params.get("once", "")):
            # Neither stays in the history of the browser, nor in its bar.
            response = RedirectResponse("/", 303)
            response.set_cookie(gate.cookie, gate.token, httponly=True, samesite="strict", path="/")
            return response
        if gate.by_cookie(request.headers):
            return FileResponse(STATIC / "index.html")
        return FileResponse(STATIC / "locked.html", status_code=401)

    async def session(request: Request) -> Response:
        """Whether the token still counts: a browser does not tell a page why its socket was refused."""
        known = gate.by_cookie(request.headers)
        return PlainTextResponse("known" if known else "unknown", 200 if known else 401)

    async def ticket(request: Request) -> Response:
        """For ``./elea panel``: what it may show on the command line of a browser."""
        known = gate.by_cookie(request.headers)
        return PlainTextResponse(gate.ticket() if known else "unknown", 200 if known else 401)

    async def socket(ws: WebSocket) -> None:
        await converse(ws, board)

    return Starlette(
        routes=[
            Route("/", home),
            Route("/session", session),
            Route("/ticket", ticket, methods=["POST"]),
            WebSocketRoute("/socket", socket),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        middleware=[Middleware(Guard, gate=gate)],
    )


async def converse(ws: WebSocket, board: Board) -> None:
    """Serve one page until it goes."""
    loop, roused = asyncio.get_running_loop(), asyncio.Event()
    try:
        await ws.accept()
    except OSError:
        return  # it went before it was let in, and has no place to give back
    page = board.join(_waker(loop, roused))
    if page is None:
        await ws.close(1013, "too many pages are open")
        return
    sender = asyncio.create_task(_send(ws, page, roused))
    pace = Pace()
    try:
        while True:
            message = await ws.receive()
            if message["type"] == "websocket.disconnect":
                return
            try:
                text = message.get("text")
                if text is None:
                    raise BadInput("only text is understood")
                if not pace.allows(loop.time()):
                    raise BadInput(f"more than {WORDS_A_SECOND} messages a second")
                said = understand(text)
                if not board.say(page, said):
                    raise BadInput("too much is said at once")
            except BadInput as error:
                board.refuse(page)
                tell_error(page, str(error))
                if page.refused > MOST_REFUSED:
                    await ws.close(1008, "too much that makes no sense")
                    return
    except WebSocketDisconnect:
        return
    finally:
        board.leave(page)
        sender.cancel()


class Pace:
    """How much a page says: WORDS_A_SECOND, in any second that begins with a word."""

    def __init__(self) -> None:
        self._since, self._count = 0.0, 0

    def allows(self, now: float) -> bool:
        """Whether another word is taken at ``now`` [s]."""
        if now - self._since > 1.0:
            self._since, self._count = now, 0
        self._count += 1
        return self._count <= WORDS_A_SECOND


def _waker(loop: asyncio.AbstractEventLoop, roused: asyncio.Event) -> Callable[[], None]:
    def wake() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(roused.set)

    return wake


async def _send(ws: WebSocket, page: Page, roused: asyncio.Event) -> None:
    """Send what waits, no faster than the page takes it."""
    try:
        while True:
            await roused.wait()
            roused.clear()
            for parcel in page.take():
                await (ws.send_text(parcel) if isinstance(parcel, str) else ws.send_bytes(parcel))
    except (WebSocketDisconnect, RuntimeError, OSError):
        return  # the reader hears of it too
