"""``elea env``: another environment's commands in this shell."""

from __future__ import annotations

from pathlib import Path

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup


@click.command("env", cls=LazyGroup, table={"ros1": LazyCommand("env:ros1", "Give this shell the commands of ROS 1.")})
def command() -> None:
    """Print shell code that brings the commands of another environment into this shell."""


@click.command("ros1", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@click.argument("name", default="")
@click.argument("words", nargs=-1, type=click.UNPROCESSED)
def ros1(name: str, words: tuple[str, ...]) -> None:
    """Give this shell the commands of ROS 1: eval "$(./elea env ros1)", in bash or zsh.

    roscore, roslaunch, rosrun, rostopic, rosnode, rosservice, rosparam, rosmsg, rossrv, rosbag, rospack, roscd,
    catkin_make, rqt, rviz and others then run on Elea, as tutorials use them, until the shell exits.

    With a NAME, that command runs: ./elea env ros1 rostopic echo /odom
    """
    if name:
        from deploy.ros1_commands.commands import run_command

        raise SystemExit(run_command(name, words))
    from deploy.ros1_commands.shell import shell_code

    click.echo(shell_code(Path.cwd()), nl=False)
