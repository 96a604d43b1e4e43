"""``elea teleop``: drive a robot of a running simulation from the keyboard."""

from __future__ import annotations

import json
import os
import sys
import time

import click

from deploy.commands.options import network_options
from services.runtime.network_address import NetworkAddress
from services.runtime.parameters.validation import build
from services.runtime.process import ROOT
from services.teleop import TeleopParameters
from services.teleop.keys import KEY_TABLE
from services.teleop.script import script_events

_ROBOT_TIMEOUT_S = 3.0
"""Wall time to wait for a starting fleet to have a robot."""
_TELEOP_PARAMETERS = (
    "speed",
    "turn",
    "speed_limit",
    "turn_limit",
    "repeat_rate",
    "key_timeout",
    "give_way",
    "frame_id",
    "keys",
)


@click.command("teleop", epilog=f"\b\nKeys, held down:\n{KEY_TABLE}")
@click.argument("namespace", default="")
@click.option("--speed", type=float, help="Initial linear speed, in m/s; 0.5 by default.")
@click.option("--turn", type=float, help="Initial turn rate, in rad/s; 1.0 by default.")
@click.option("--speed-limit", type=float, help="Maximum linear speed that scaling can reach, in m/s.")
@click.option("--turn-limit", type=float, help="Maximum turn rate that scaling can reach, in rad/s.")
@click.option(
    "--repeat-rate", type=float, help="Commands per second while a key is held; 20 by default, 0 for key events only."
)
@click.option(
    "--key-timeout", type=float, help="How long a key counts as held after its first event, in s; 0.6 by default."
)
@click.option("--fixed", is_flag=True, help="Wait --key-timeout after every event, as teleop_twist_keyboard does.")
@click.option("--give-way", type=float, help="How long zero is sent after the last key, in s; 3 by default.")
@click.option("--stamped", is_flag=True, help="Publish TwistStamped instead of Twist.")
@click.option("--frame-id", help="Frame in the header of a TwistStamped.")
@click.option(
    "--keys", metavar="SCRIPT", help="Play a script of keys, KEY@FROM[-TO] in simulation s, e.g. 'i@0.5-2 k@2.5'."
)
@network_options
def command(namespace: str, fixed: bool, stamped: bool, address: NetworkAddress, **values: object) -> None:
    """Drive the robot in NAMESPACE, e.g. /p3dx; may be omitted if there is only one robot.

    The robot moves while a key is held. Teleop overrides a controller, and returns the robot to it a few seconds after
    the last key.
    """
    from services.runtime.graph import snapshot
    from services.runtime.light_node import open_transport
    from services.teleop.robot import choose_base, find_bases

    parameters = {name: values[name] for name in _TELEOP_PARAMETERS if values[name] is not None}
    parameters |= {"adaptive": False} if fixed else {}
    parameters |= {"stamped": True} if stamped else {}
    params = build(TeleopParameters, parameters, "teleop")
    if not script_events(params):
        from services.teleop.terminal import require_terminal

        require_terminal()
    with open_transport(address.router, address.domain) as transport:
        deadline = time.monotonic() + _ROBOT_TIMEOUT_S
        while not (found := find_bases(snapshot(transport))) and time.monotonic() < deadline:
            time.sleep(0.1)
    base = choose_base(namespace, found, address.router)
    arguments = ["--namespace", base.namespace, *address.arguments]
    arguments += [word for name, value in parameters.items() for word in ("--param", f"{name}={json.dumps(value)}")]
    sys.stdout.flush()
    os.execve(
        sys.executable,
        [sys.executable, "-P", "-m", "services", "teleop", *arguments],
        {**os.environ, "PYTHONPATH": str(ROOT)},
    )
