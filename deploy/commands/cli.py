"""The table of verbs, and the command that dispatches to them."""

from __future__ import annotations

import difflib
import importlib
import sys
from typing import NamedTuple

import click

from deploy.version import VERSION
from services.runtime.errors import BadInput, EleaError


class Verb(NamedTuple):
    """Where a verb's command lies (module of this package, and name in it), and what it does in one line."""

    module: str
    about: str


VERBS = {
    "up": Verb("up", "Run a fleet to its report; lab by default."),
    "down": Verb("down", "End a running fleet."),
    "ps": Verb("ps", "List the processes of the running fleets."),
    "logs": Verb("logs", "Show what the processes of a fleet have written."),
    "restart": Verb("restart", "Restart a process of a running fleet."),
    "graph": Verb("graph", "List the nodes and topics of the network."),
    "param": Verb("param", "Read and change the parameters of running services."),
    "run": Verb("run", "Run one service, or a Python file of your own."),
    "panel": Verb("panel", "Open the web page of a running fleet."),
    "teleop": Verb("teleop", "Drive a robot from the keyboard."),
    "test": Verb("test", "Run the tests."),
    "bench": Verb("bench", "Measure the middleware against raw Zenoh and raw PyBullet."),
}


class Verbs(click.Group):
    """Loads a verb when it is asked for; a wrong name is answered with the nearest right one."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        verb = VERBS.get(cmd_name)
        if verb is None:
            return None
        command = importlib.import_module(f"deploy.commands.{verb.module}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], VERBS, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            ctx.fail(f"unknown verb {args[0]!r}{hint} (known: {', '.join(VERBS)})")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(name, verb.about) for name, verb in VERBS.items()])


@click.command(cls=Verbs, name="elea")
@click.version_option(VERSION, prog_name="elea")
def elea() -> None:
    """Robots in simulation on Zenoh: processes that run, grade themselves and repeat bit for bit.

    Exit status: 0 all is well, 1 it failed or missed a bound, 2 bad input, 130 interrupted before the run's own end.
    """


def main() -> None:
    """Run the command line and end the process with its status."""
    try:
        elea.main(prog_name="elea")
    except BadInput as error:
        sys.stderr.write(f"elea: {error}\n")
        sys.exit(2)
    except EleaError as error:
        sys.stderr.write(f"elea: {error}\n")
        sys.exit(1)
