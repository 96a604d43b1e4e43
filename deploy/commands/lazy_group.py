"""A click group whose commands are imported when called."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import click
from click.shell_completion import CompletionItem

from deploy import INTERRUPTED


class LazyCommand(NamedTuple):
    """The location of a command, and its one-line help.

    ``module`` is in ``deploy.commands``; its attribute is ``command`` unless given after a colon.
    """

    module: str
    about: str


class LazyGroup(click.Group):
    """Imports a command when it is called; suggests the nearest name for a wrong one."""

    def __init__(self, *arguments: Any, table: Mapping[str, LazyCommand], **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.table = table

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        entry = self.table.get(cmd_name)
        if entry is None:
            return None
        module, _, name = entry.module.partition(":")
        command = getattr(importlib.import_module(f"deploy.commands.{module}"), name or "command")
        assert isinstance(command, click.Command)
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an unhandled Ctrl-C ends it with a status of its own, not as a failure."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            ctx.exit(INTERRUPTED)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self.table and not args[0].startswith("-"):
            from messages.errors import did_you_mean

            ctx.fail(f"unknown command {args[0]!r}{did_you_mean(args[0], self.table)} (known: {', '.join(self.table)})")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.about) for name, entry in self.table.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem[Any]]:
        """Return the commands in the table, without loading them, and the group's options."""
        commands = [CompletionItem(name, help=entry.about) for name, entry in self.table.items()]
        found: list[CompletionItem[Any]] = [each for each in commands if each.value.startswith(incomplete)]
        return found or click.Command.shell_complete(self, ctx, incomplete)
