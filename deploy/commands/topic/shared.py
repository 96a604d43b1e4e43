"""Options that several verbs of ``elea topic`` share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

from deploy.commands.completion import TOPIC
from deploy.commands.options import json_option, place_options

topic_argument: Callable[[Any], Any] = click.argument("topic", type=TOPIC)

wait_option: Callable[[Any], Any] = click.option(
    "--wait", is_flag=True, help="Wait for a topic that nobody knows yet, instead of failing."
)
timeout_option: Callable[[Any], Any] = click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), metavar="S", help="End after S seconds of wall time."
)


def measuring(window: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The options of a verb that measures; it gets ``place``, ``window`` and ``terms``."""

    def decorate(verb: Callable[..., Any]) -> Callable[..., Any]:
        @click.option(
            "-w", "--window", type=click.IntRange(2), default=window, show_default=True, help="Newest messages counted."
        )
        @click.option("-n", "--count", type=click.IntRange(1), default=None, help="End after N messages of each topic.")
        @timeout_option
        @wait_option
        @place_options
        @json_option
        @functools.wraps(verb)
        def measured(count: int | None, timeout: float | None, wait: bool, as_json: bool, **values: Any) -> Any:
            from deploy.live.measure import Terms

            return verb(terms=Terms(count or 0, timeout, wait, as_json), **values)

        made: Callable[..., Any] = measured
        return made

    return decorate
