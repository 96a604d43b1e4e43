"""``elea sim``: time and emergency stops of the running simulation; see also sim_models."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Self, TypeVar

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option, network_options
from deploy.live.output import format_table, write_text
from services.runtime.network_address import NetworkAddress

if TYPE_CHECKING:
    from messages.base import Message
    from messages.requests import Request
    from services.runtime.transport.api import Transport

COMMANDS = {
    "list": LazyCommand("sim_models:list_", "List the models with their poses."),
    "spawn": LazyCommand("sim_models:spawn", "Spawn a model."),
    "delete": LazyCommand("sim_models:delete", "Delete a model."),
    "state": LazyCommand("sim_models:state", "Show the pose and twist of a model or link."),
    "set-state": LazyCommand("sim_models:set_state", "Move a model."),
    "properties": LazyCommand("sim_models:properties", "Show properties of the world, a model or a link."),
    "joints": LazyCommand("sim_models:joints", "Show type, limits, state and effort of joints."),
    "effort": LazyCommand("sim_models:effort", "Apply an effort to a joint for some time."),
    "wrench": LazyCommand("sim_models:wrench", "Apply a force and torque to a link."),
    "clear": LazyCommand("sim_models:clear", "Clear the efforts on a joint."),
    "configure": LazyCommand("sim_models:configure", "Set joint positions."),
    "stops": LazyCommand("sim:stops", "List the emergency stops and their holders."),
    "release": LazyCommand("sim:release", "Release an emergency stop whose holder is gone."),
    "pause": LazyCommand("sim:pause", "Pause simulation time."),
    "resume": LazyCommand("sim:resume", "Resume simulation time."),
    "step": LazyCommand("sim:step", "Run physics steps of 5 ms while paused."),
    "reset": LazyCommand("sim:reset", "Reset time to zero and all models to their spawn poses."),
    "reset-world": LazyCommand("sim:reset_world", "Reset all models to their spawn poses; time continues."),
}


@click.command(cls=LazyGroup, name="sim", table=COMMANDS)
def command() -> None:
    """Query and control the running simulation: models, joints, forces and time.

    A joint or link is named model::name or model/name, or by its name alone if only one model has it. Times are
    simulation times.
    """


R = TypeVar("R", bound="Message")

TIMEOUT_S = 5.0
"""Default wall time for a request [s]."""
STEP_TIMEOUT_S = 600.0
"""That for steps, which are answered once all are taken: up to 5000 s of simulation time."""


class SimulationClient:
    """Calls the services of a fleet, which it joins at the first call, and prints the responses."""

    def __init__(self, address: NetworkAddress, timeout: float, as_json: bool) -> None:
        self._address, self._timeout, self._as_json = address, timeout, as_json
        self._exit_stack = ExitStack()
        self._transport: Transport | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._exit_stack.close()

    def call(self, request: Request[Any, R], message: Message) -> R:
        """Return the response to a request; raises CallFailed with the reason, BadInput without a router."""
        from messages.names import key
        from services.runtime.light_node import open_transport
        from services.runtime.requests import call

        if self._transport is None:
            self._transport = self._exit_stack.enter_context(open_transport(self._address.router, self._address.domain))
        return call(self._transport, request, key(request.name), message, self._timeout)

    def print_reply(self, reply: Message | Iterable[Message], text: str) -> None:
        """Print the response as JSON, or the given text."""
        if not self._as_json:
            write_text(f"{text}\n" if text else "")
            return
        import msgspec

        plain = msgspec.to_builtins(reply)
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(plain), indent=2).decode() + "\n")


def simulation_command(command: Callable[..., Any], default_timeout: float = TIMEOUT_S) -> Callable[..., Any]:
    """Add ``--connect``, ``--domain``, ``--port``, ``--timeout`` and ``--json``; the verb gets a SimulationClient."""

    @click.option(
        "--timeout",
        type=click.FloatRange(0, min_open=True),
        default=default_timeout,
        help=f"Wall time to wait for the answer, in seconds; {default_timeout:g} by default.",
    )
    @network_options
    @json_option
    @functools.wraps(command)
    def wrapped(address: NetworkAddress, timeout: float, as_json: bool, **given: Any) -> Any:
        with SimulationClient(address, timeout, as_json) as client:
            return command(client, **given)

    return wrapped


def parse_joint_positions(pairs: Iterable[str]) -> dict[str, float]:
    """Parse ``name=number`` words; raises click's error for another form."""
    found: dict[str, float] = {}
    for pair in pairs:
        name, equals, value = pair.rpartition("=")
        try:
            found[name] = float(value)
        except ValueError:
            equals = ""
        if not equals or not name:
            raise click.BadParameter(f"{pair!r}: write it as joint=position, in rad or m")
    return found


@click.command("pause")
@simulation_command
def pause(client: SimulationClient) -> None:
    """Pause simulation time."""
    from messages.requests import PAUSE

    _call_and_print(client, PAUSE, "paused")


@click.command("resume")
@simulation_command
def resume(client: SimulationClient) -> None:
    """Resume simulation time."""
    from messages.requests import RESUME

    _call_and_print(client, RESUME, "running")


@click.command("step")
@click.argument("count", type=click.IntRange(1, 1_000_000), default=1)
@functools.partial(simulation_command, default_timeout=STEP_TIMEOUT_S)
def step(client: SimulationClient, count: int) -> None:
    """Run COUNT physics steps (1 by default) of 5 ms while time is paused."""
    from messages.requests import STEP
    from messages.simulation import Steps

    reply = client.call(STEP, Steps(count=count))
    client.print_reply(reply, f"{count} steps taken: t = {reply.time / 1e9:.3f} s")


@click.command("reset")
@simulation_command
def reset(client: SimulationClient) -> None:
    """Reset time to zero and all models to their spawn poses; clear all efforts and wrenches."""
    from messages.requests import RESET

    _call_and_print(client, RESET, "reset")


@click.command("reset-world")
@simulation_command
def reset_world(client: SimulationClient) -> None:
    """Reset all models to their spawn poses; time continues."""
    from messages.requests import RESET_WORLD

    _call_and_print(client, RESET_WORLD, "models are where they were spawned")


def _call_and_print(client: SimulationClient, request: Request[Any, Any], done: str) -> None:
    from messages.std import Empty

    reply = client.call(request, Empty())
    client.print_reply(reply, f"{done}: t = {reply.time / 1e9:.3f} s")


@click.command("stops")
@simulation_command
def stops(client: SimulationClient) -> None:
    """List the emergency stops, with their holders and times."""
    from datetime import datetime

    from messages.requests import LIST_STOPS
    from messages.std import Empty

    reply = client.call(LIST_STOPS, Empty())
    rows = [("robot", "holder", "since", "reset by its holder with false on")]
    for each in reply.stops:
        since = f"{datetime.fromtimestamp(each.since // 1_000_000_000):%Y-%m-%d %H:%M:%S}"
        rows.append((each.robot or "(all robots)", each.holder, since, each.topic))
    client.print_reply(reply, format_table(rows) if reply.stops else "no robot is stopped")


@click.command("release")
@click.argument("name", default="")
@click.option("--all", "every", is_flag=True, help="Release the stop of all robots (/e_stop) instead of one robot's.")
@click.option("--holder", default="", help="Release only this node's stop, by name or id as listed by `stops`.")
@simulation_command
def release(client: SimulationClient, name: str, every: bool, holder: str) -> None:
    """Release the emergency stop of the robot NAME on behalf of its holders.

    Use this for holders that are gone for good; a running holder resets its stop itself by publishing false. A
    publisher that still publishes true stops the robot again when the simulation restarts.
    """
    from messages.requests import RELEASE_STOP
    from messages.simulation import ReleaseStop

    if every == bool(name):
        raise click.UsageError("give the NAME of a robot, or --all for the stop of all robots")
    reply = client.call(RELEASE_STOP, ReleaseStop(name=name, holder=holder))
    client.print_reply(reply, reply.text)
