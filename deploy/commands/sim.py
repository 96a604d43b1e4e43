"""``elea sim``: ask the running simulation: its models, joints, forces and time."""

from __future__ import annotations

import difflib

import click

from deploy.commands import sim_joints, sim_models, sim_time


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
    sim_models.list_,
    sim_models.spawn,
    sim_models.delete,
    sim_models.state,
    sim_models.set_state,
    sim_models.properties,
    sim_joints.joints,
    sim_joints.effort,
    sim_joints.wrench,
    sim_joints.clear,
    sim_joints.configure,
    sim_time.pause,
    sim_time.resume,
    sim_time.step,
    sim_time.reset,
    sim_time.reset_world,
)

command = Doings(
    "sim",
    {each.name: each for each in COMMANDS if each.name},
    help="""Ask the running simulation: its models, joints, forces and time.

    A joint or link is named alone where one model only has it, or as model::name or model/name. All times are of the
    simulation.
    """,
)
