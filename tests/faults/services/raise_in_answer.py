"""Raises while answering a request."""

from __future__ import annotations

from messages.requests import Done, Name, Request
from services.runtime import Parameters, Service, main
from services.runtime.context import Context

ASK = Request("~ask", Name, Done, "raises")


def answer(_: Name) -> Done:
    raise ZeroDivisionError("planted in the answer")


def run(ctx: Context[Parameters]) -> None:
    ctx.serve(ASK, answer)
    for _ in ctx.ticks():
        pass


if __name__ == "__main__":
    main(Service(name="raise_in_answer", about="fails when asked", run=run, rate=25))
