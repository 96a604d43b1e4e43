"""The command line ``elea``: the table of commands and their dispatch."""

from __future__ import annotations

import os
import sys

import click

from deploy import VERSION
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.live.output import printable
from services.runtime.errors import BadInput, EleaError
from services.runtime.process import lossy_stderr

COMMANDS = {
    "up": LazyCommand("up", "Run a fleet (lab by default) and report on it."),
    "down": LazyCommand("fleet:down_command", "Stop a running fleet."),
    "ps": LazyCommand("fleet:ps_command", "List the processes of the running fleets."),
    "logs": LazyCommand("fleet:logs_command", "Show the logs of a fleet's processes."),
    "restart": LazyCommand("fleet:restart_command", "Restart a process of a running fleet."),
    "graph": LazyCommand("node:graph_command", "List the nodes and topics of the network."),
    "sim": LazyCommand("sim", "Query and control the running simulation."),
    "param": LazyCommand("param", "Read and change the parameters of running services."),
    "topic": LazyCommand("topic", "List, show, measure and publish topics."),
    "node": LazyCommand("node", "List nodes, show one or ping it."),
    "service": LazyCommand("service", "List services or call one."),
    "world": LazyCommand("world", "List and check worlds, or write one as a map."),
    "model": LazyCommand("model", "List the robot models, or check one of your own."),
    "interface": LazyCommand("interface", "List message and service types or show one."),
    "tf": LazyCommand("tf", "Show the frame tree, or the transform between two frames."),
    "doctor": LazyCommand("diagnostics:doctor_command", "Check the machine, the installation and the network."),
    "run": LazyCommand("run", "Run a service, or a Python file of your own."),
    "rosrun": LazyCommand("rosrun", "Run a program of a ROS 1 package."),
    "roslaunch": LazyCommand("roslaunch", "Run a launch file of ROS 1."),
    "rostest": LazyCommand("rostest", "Run the tests of a launch file of ROS 1."),
    "env": LazyCommand("env", "Give this shell the commands of ROS 1."),
    "python": LazyCommand("run:python_command", "Run Python, or a program, that can import Elea."),
    "new": LazyCommand("new", "Make a folder to start from, e.g. for an exercise."),
    "panel": LazyCommand("panel", "Open the web page of a running fleet."),
    "teleop": LazyCommand("teleop", "Drive a robot from the keyboard."),
    "bag": LazyCommand("bag", "Record, play, inspect and export bags."),
    "view": LazyCommand("view", "Open a run, a recording or a bag in the viewer, or render it to pictures."),
    "sweep": LazyCommand("sweep", "Run a fleet with every combination of seeds and values."),
    "report": LazyCommand("report", "Show the report of a run."),
    "diff": LazyCommand("diff", "Show where two runs differ."),
    "check": LazyCommand("check", "Check the code and run the quick tests, as before a commit."),
    "test": LazyCommand("diagnostics:test_command", "Run the tests."),
    "bench": LazyCommand("diagnostics:bench_command", "Measure the middleware against raw Zenoh and raw physics."),
}


@click.command(cls=LazyGroup, table=COMMANDS, name="elea")
@click.version_option(VERSION, prog_name="elea")
def elea() -> None:
    """Simulated robots on Zenoh, in runs that grade themselves and repeat bit for bit.

    Exit status: 0 success, 1 failure or a missed bound, 2 bad input, 75 temporary failure (a name or port is taken, or
    the network cannot be reached), 130 interrupted.
    """


def main() -> None:
    """Run the command line; raises SystemExit with its status.

    A closed standard output ends it quietly; a closed standard error does not.
    """
    if "_ELEA_COMPLETE" in os.environ:
        from deploy.commands.completion import register_shells

        register_shells()
    lossy_stderr()
    sys.exit(_run_and_flush())


def _run_and_flush() -> int:
    status = 0
    try:
        status = _run()
        sys.stdout.flush()
    except BrokenPipeError:
        from deploy.live.output import discard_output

        discard_output()
    return status


def _run() -> int:
    out = sys.stdout
    try:
        elea.main(prog_name="elea")
    except SystemExit as ended:
        # On a closed pipe, click exits with status 1 and replaces the output stream.
        return _exit_status(ended) if sys.stdout is out else 0
    except BadInput as error:
        sys.stderr.write(printable(f"elea: {error}\n"))
        return 2
    except EleaError as error:
        sys.stderr.write(printable(f"elea: {error}\n"))
        return 1
    return 0


def _exit_status(ended: SystemExit) -> int:
    """Return the exit status; text instead of a status is printed as an error."""
    if ended.code is None or isinstance(ended.code, int):
        return ended.code or 0
    sys.stderr.write(f"{ended.code}\n")
    return 1
