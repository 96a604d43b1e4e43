"""``elea sim``: ask the running simulation: its models, joints, forces and time."""

from __future__ import annotations

import difflib

import click

from deploy.commands.sim import joints, models, time


class Doings(click.Group):
    """A wrong name is answered with the nearest right one."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], self.commands, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            ctx.fail(f"unknown doing {args[0]!r}{hint} (known: {', '.join(self.commands)})")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


COMMANDS = (
    models.list_,
    models.spawn,
    models.delete,
    models.state,
    models.set_state,
    models.properties,
    joints.joints,
    joints.effort,
    joints.wrench,
    joints.clear,
    joints.configure,
    time.pause,
    time.resume,
    time.step,
    time.reset,
    time.reset_world,
)

command = Doings(
    "sim",
    {each.name: each for each in COMMANDS if each.name},
    help="""Ask the running simulation: its models, joints, forces and time.

    A joint or link is named alone where one model only has it, or as model::name or model/name. All times are of the
    simulation.
    """,
)
