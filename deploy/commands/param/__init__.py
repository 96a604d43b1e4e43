"""``elea param``: the parameters of running services, as rosparam, ros2 param and dynparam together."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

VERBS = {
    "list": Verb("param.look:list_command", "List the sets of parameters, or the parameters of one."),
    "get": Verb("param.look:get_command", "Show values and where they come from."),
    "describe": Verb("param.look:describe_command", "Show types, bounds, defaults, units and texts."),
    "set": Verb("param.change:set_command", "Change parameters, all or none."),
    "reset": Verb("param.change:reset_command", "Forget what was set: fleet file and defaults count again."),
    "undo": Verb("param.change:undo_command", "Take the newest change of a set back."),
    "dump": Verb("param.transfer:dump_command", "Write values as YAML or TOML."),
    "load": Verb("param.transfer:load_command", "Set the values of a YAML or TOML file."),
    "history": Verb("param.look:history_command", "Show who changed what, and when."),
}


@click.command(cls=Verbs, name="param", table=VERBS)
def command() -> None:
    """Read and change the parameters of running services, checked and kept by the parameter service.

    SET is the name of a set as `list` shows it, with or without the leading slash, or of a node that follows it.

    Exit status: 0 done, 1 refused, failed, or the answer was lost and the outcome unknown, 2 bad input.
    """
