"""Lists every command of the command line, with its subcommands."""

from __future__ import annotations

import click

from deploy.commands.cli import elea
from deploy.commands.lazy_group import LazyGroup


def all_commands() -> list[tuple[str, ...]]:
    """Return the words of each command and subcommand, for example ``("topic",)`` and ``("topic", "echo")``."""
    return _below(elea, ())


def _below(command: click.Command, words: tuple[str, ...]) -> list[tuple[str, ...]]:
    if not isinstance(command, click.Group):
        return []
    assert isinstance(command, LazyGroup)
    found = []
    for name in command.list_commands(click.Context(command)):
        inner = command.get_command(click.Context(command), name)
        assert inner is not None
        found += [(*words, name), *_below(inner, (*words, name))]
    return found
