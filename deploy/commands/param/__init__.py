"""``elea param``: the parameters of running services, as rosparam, ros2 param and dynparam together."""

from __future__ import annotations

import importlib

import click

from services.runtime.errors import unknown

VERBS = {
    "list": ("look", "List the sets of parameters, or the parameters of one."),
    "get": ("look", "Show values and where they come from."),
    "describe": ("look", "Show types, bounds, defaults, units and texts."),
    "set": ("change", "Change parameters, all or none."),
    "reset": ("change", "Forget what was set: fleet file and defaults count again."),
    "undo": ("change", "Take the newest change of a set back."),
    "dump": ("transfer", "Write values as YAML or TOML."),
    "load": ("transfer", "Set the values of a YAML or TOML file."),
    "history": ("look", "Show who changed what, and when."),
}
"""Each verb with the module of its command, ``NAME_command`` in it, and what it does."""


class ParamVerbs(click.Group):
    """Loads a verb when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        module = importlib.import_module(f"deploy.commands.param.{VERBS[cmd_name][0]}")
        found = getattr(module, f"{cmd_name}_command")
        assert isinstance(found, click.Command)
        return found

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            ctx.fail(str(unknown("verb", args[0], VERBS)))
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(name, about) for name, (_, about) in VERBS.items()])


@click.command(cls=ParamVerbs, name="param")
def command() -> None:
    """Read and change the parameters of running services, checked and kept by the parameter service.

    SET is the name of a set as `list` shows it, with or without the leading slash, or of a node that follows it.

    Exit status: 0 done, 1 refused, failed, or the answer was lost and the outcome unknown, 2 bad input.
    """
