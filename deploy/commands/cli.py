"""The table of verbs, and the command that dispatches to them."""

from __future__ import annotations

import os
import sys

import click

from deploy.commands.table import Verb, Verbs
from deploy.live.output import printable
from deploy.version import VERSION
from services.runtime.errors import BadInput, EleaError
from services.runtime.process import lossy_stderr

VERBS = {
    "up": Verb("up", "Run a fleet to its report; lab by default."),
    "down": Verb("down", "End a running fleet."),
    "ps": Verb("ps", "List the processes of the running fleets."),
    "logs": Verb("logs", "Show what the processes of a fleet have written."),
    "restart": Verb("restart", "Restart a process of a running fleet."),
    "graph": Verb("graph", "List the nodes and topics of the network."),
    "sim": Verb("sim", "Ask the running simulation: models, joints, forces, time."),
    "param": Verb("param", "Read and change the parameters of running services."),
    "topic": Verb("topic", "List, show, measure and publish topics."),
    "node": Verb("node", "List nodes and tell of one."),
    "service": Verb("service", "List requests and call one."),
    "interface": Verb("interface", "List the types of messages and requests and show one."),
    "tf": Verb("tf", "Show the tree of frames, and where one lies in another."),
    "doctor": Verb("doctor", "Check the machine, the installation and the network."),
    "run": Verb("run", "Run one service, or a Python file of your own."),
    "panel": Verb("panel", "Open the web page of a running fleet."),
    "teleop": Verb("teleop", "Drive a robot from the keyboard."),
    "bag": Verb("bag", "Record, play, inspect and export bags."),
    "view": Verb("view", "Open a run, a recording or a bag in the viewer, or make its pictures."),
    "test": Verb("test", "Run the tests."),
    "bench": Verb("bench", "Measure the middleware against raw Zenoh and raw PyBullet."),
}


@click.command(cls=Verbs, table=VERBS, name="elea")
@click.version_option(VERSION, prog_name="elea")
def elea() -> None:
    """Robots in simulation on Zenoh: processes that run, grade themselves and repeat bit for bit.

    Exit status: 0 all is well, 1 it failed or missed a bound, 2 bad input, 130 interrupted before the run's own end,
    75 for a service that may work later: its name or port is taken, or the network is out of reach.
    """


def main() -> None:
    """Run the command line; raises SystemExit with its status.

    A reader that closes standard output ends it quietly, one that closes standard error does not.
    """
    if "_ELEA_COMPLETE" in os.environ:
        from deploy.commands.completion_scripts import register

        register()
    lossy_stderr()
    sys.exit(_status())


def _status() -> int:
    status = 0
    try:
        status = _run()
        sys.stdout.flush()
    except BrokenPipeError:
        from deploy.live.output import mute

        mute()
    return status


def _run() -> int:
    out = sys.stdout
    try:
        elea.main(prog_name="elea")
    except SystemExit as ended:
        # Of a closed pipe click makes a status of 1, and puts something that bears it in the place of the output.
        return _number(ended) if sys.stdout is out else 0
    except BadInput as error:
        sys.stderr.write(printable(f"elea: {error}\n"))
        return 2
    except EleaError as error:
        sys.stderr.write(printable(f"elea: {error}\n"))
        return 1
    return 0


def _number(ended: SystemExit) -> int:
    """The exit status; a text in its place is an error that is told."""
    if ended.code is None or isinstance(ended.code, int):
        return ended.code or 0
    sys.stderr.write(f"{ended.code}\n")
    return 1
