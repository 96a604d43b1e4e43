"""The command line of a script's process: Elea's options before the file, the script's own arguments after it."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import click

from services.runtime.errors import TRY_AGAIN, BadInput, EleaError, TryAgain
from services.runtime.main import network_options, parse_options


def main() -> None:
    """Run the script of the command line and end the process with its exit status."""
    from services.runtime import process

    process.install_signal_handlers(lambda: process.exit_now(0))  # until the script begins
    options = parse_options("script", _COMMAND, sys.argv[1:], "python -m services.script")
    _pin_hashes(options)
    process.die_with_parent()
    process.exit_now(_run(options))


def _run(options: dict[str, Any]) -> int:
    """Run the script; return its exit status."""
    try:
        from services.script.run import run_script

        return run_script(options)
    except BadInput as error:
        sys.stderr.write(f"{Path(options['file']).name}: {error}\n")
        return TRY_AGAIN if isinstance(error, TryAgain) else 2
    except EleaError as error:
        sys.stderr.write(f"{Path(options['file']).name}: {error}\n")
        return 1


def hash_environment(seed: int) -> dict[str, str]:
    """Return the environment of a script in lockstep, which fixes the order of sets by the run's seed."""
    return {"PYTHONHASHSEED": str(seed % 4294967296)}


def _pin_hashes(options: dict[str, Any]) -> None:
    """In lockstep, restart the process with a fixed order of sets, unless the fleet set the environment.

    Python reads the seed of its hashes before anything runs.
    """
    environment = hash_environment(options["seed"])
    if options["lockstep"] and not environment.items() <= os.environ.items():
        os.environ.update(environment)
        os.execv(sys.executable, [sys.executable, "-P", "-m", "services.script", *sys.argv[1:]])


def _check(**options: Any) -> dict[str, Any] | None:
    from messages.names import BadName, Identity, parse_remap
    from services.script.inspect_script import legal_node_name

    if options["explain"]:
        from services.script.budget import explain

        click.echo(explain())
        return None
    if options["file"] is None:
        raise click.UsageError("Missing argument 'FILE': the script to run.")
    try:
        for each in options["remap"]:
            if not each.startswith("_"):
                parse_remap(each)
        Identity.of(options["name"] or "script", options["namespace"])
    except BadName as error:
        raise BadInput(str(error)) from None
    file = Path(options["file"])
    if not file.is_file():
        raise BadInput(f"{file}: there is no such file" if not file.exists() else f"{file} is not a file")
    if options["wall_time"] and options["lockstep"]:
        raise BadInput("--wall-time and --lockstep exclude each other")
    if options["lockstep"] and not options["name"]:
        options["name"] = legal_node_name(file.stem) or "script"
    return options


_option = click.Option
_COMMAND = click.Command(
    "script",
    callback=_check,
    help="Run a script that was written for ROS 1. What follows FILE belongs to the script.",
    context_settings={"ignore_unknown_options": False, "allow_interspersed_args": False},
    params=[
        _option(["--namespace"], default="/", help="Namespace of the node's relative names, such as /tb3_0."),
        _option(["--name"], default="", help="Name of the node, in place of the script's."),
        _option(["--remap"], multiple=True, metavar="FROM:=TO", help="Use another name; _K:=V sets a parameter."),
        *(each for each in network_options() if each.name != "print_config"),
        _option(["--rate"], type=click.FloatRange(1, 200), default=100.0, help="Maximum steps per second in lockstep."),
        _option(["--frame-prefix"], default="", help="Prefix of its robot's frames, e.g. tb3_0/."),
        _option(["--wall-time"], is_flag=True, help="Follow the wall clock; no simulation is needed."),
        _option(["--seed"], type=click.IntRange(0), default=0, help="Seed of its random numbers in lockstep."),
        _option(["--explain"], is_flag=True, help="Show the budget of a turn in lockstep, and exit."),
        click.Argument(["file"], required=False, type=click.Path()),
        click.Argument(["args"], nargs=-1, type=click.UNPROCESSED),
    ],
)
