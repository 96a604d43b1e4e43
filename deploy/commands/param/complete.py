"""Completion of the names of sets and parameters, asked of the network, or nothing where it takes too long."""

from __future__ import annotations

import atexit
import os
import sys
import threading
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

if TYPE_CHECKING:
    from messages.parameters import ParameterSchema

WITHIN_S = 0.3
"""Wall time that a person who presses Tab waits for the network."""


def set_names(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The names of sets."""
    names = sorted(_sets(ctx))
    if not incomplete.startswith("/"):
        names = [each[1:] for each in names]
    return [CompletionItem(each) for each in names if each.startswith(incomplete)]


def parameter_names(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The names of the parameters of the set that the line has, each with its text."""
    from deploy.commands.param.client import found
    from services.runtime.errors import BadInput

    try:
        one = found(str(ctx.params.get("set_name", "")), _sets(ctx))
    except BadInput:
        return []
    return [CompletionItem(each.name, help=each.text) for each in one.parameters if each.name.startswith(incomplete)]


def _sets(ctx: click.Context) -> dict[str, ParameterSchema]:
    """All sets, or none when nobody answers within WITHIN_S."""
    from deploy.commands.network import place, visit
    from deploy.commands.param.client import Client
    from services.runtime import zenoh_transport
    from services.runtime.errors import EleaError

    assert zenoh_transport  # loading it is not the network's time
    params, answer = ctx.params, {}

    def ask() -> None:
        try:
            where = place(params.get("connect") or "", params.get("domain") or "", params.get("port"))
            with visit(*where) as transport:
                answer.update(Client(transport, WITHIN_S).sets())
        except EleaError:
            return

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(WITHIN_S)
    if thread.is_alive():
        atexit.register(_leave)
        return {}
    return answer


def _leave() -> None:
    """End without waiting for the network's threads."""
    sys.stdout.flush()
    os._exit(0)
