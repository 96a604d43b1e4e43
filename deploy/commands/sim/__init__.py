"""``elea sim``: ask the running simulation: its models, joints, forces and time."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

VERBS = {
    "list": Verb("sim.models:list_", "List the models with their poses."),
    "spawn": Verb("sim.models:spawn", "Put a model into the world."),
    "delete": Verb("sim.models:delete", "Take a model out of the world."),
    "state": Verb("sim.models:state", "Tell pose and twist of a model or a link."),
    "set-state": Verb("sim.models:set_state", "Move a model."),
    "properties": Verb("sim.models:properties", "Tell what the world, a model or a link is made of."),
    "joints": Verb("sim.joints:joints", "Tell what joints are and do."),
    "effort": Verb("sim.joints:effort", "Put an effort on a joint for a time."),
    "wrench": Verb("sim.joints:wrench", "Push and twist a link."),
    "clear": Verb("sim.joints:clear", "Drop the efforts on a joint."),
    "configure": Verb("sim.joints:configure", "Put joints at positions, at rest."),
    "stops": Verb("sim.stops:stops", "List the emergency stops: who holds which robot."),
    "release": Verb("sim.stops:release", "Release an emergency stop for those who hold it."),
    "pause": Verb("sim.time:pause", "Stop simulation time."),
    "resume": Verb("sim.time:resume", "Let simulation time go on."),
    "step": Verb("sim.time:step", "Run physics steps of 5 ms while time is paused."),
    "reset": Verb("sim.time:reset", "Time to zero, all models to where they were spawned."),
    "reset-world": Verb("sim.time:reset_world", "As reset, but time goes on."),
}


@click.command(cls=Verbs, name="sim", table=VERBS)
def command() -> None:
    """Ask the running simulation: its models, joints, forces and time.

    A joint or link is named alone where one model only has it, or as model::name or model/name. All times are of the
    simulation.
    """
