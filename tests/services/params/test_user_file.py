"""A user's controller, run from a file: its parameters are typed, live and saved like those of any service."""

from __future__ import annotations

import json
from pathlib import Path

from messages.topics import CMD_VEL
from services.runtime.node import Node
from tests.harness.fork_server import run_verb
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.services.params.parameter_client import connected_client, start_and_wait

PROGRAM = '''
from typing import Annotated

from msgspec import Meta

from messages.geometry import Twist
from messages.topics import CMD_VEL
from services.runtime import Parameters, Service, main


class Mine(Parameters):
    """How I drive."""

    speed: Annotated[float, Meta(ge=0, le=0.5, description="how fast", extra={"unit": "m/s"})] = 0.1
    turn: float = 0.0


def run(ctx):
    for _ in ctx.ticks():
        ctx.publish(CMD_VEL, Twist.planar(ctx.params.speed, ctx.params.turn))


main(Service(name="mine", about="Drives as told.", run=run, rate=20, parameters=Mine))
'''
SET = "/tb3_0/mine"


def elea(network: Network, *words: str) -> tuple[int, str]:
    """Run a command; return its exit status and output."""
    done = run_verb(*words, "--connect", network.endpoint, "--timeout", "60", within=120.0)
    return done.returncode, done.stdout + done.stderr


def test_the_parameters_of_a_file_are_set_checked_followed_and_kept(tmp_path: Path) -> None:
    file = tmp_path / "my_controller.py"
    file.write_text(PROGRAM)
    with Network(tmp_path) as network, connected_client(network) as client, network.node() as node:
        start_and_wait(network, client, tmp_path / "params.db")
        network.start("sim", "--param", "mode=real")
        mine = network.run(file, "--namespace", "tb3_0", "--param", "turn=0.2")
        commands = Commands(node)
        commands.until(0.1, 0.2)

        status, said = elea(network, "param", "set", SET, "speed", "0.3")
        assert status == 0, said
        commands.until(0.3, 0.2)
        for value, why in (("0.6", "0.5"), ("nan", "finite"), ("fast", "it is a text")):
            status, said = elea(network, "param", "set", SET, "speed", value)
            assert status != 0
            assert "speed" in said, why
            assert why in said
        status, said = elea(network, "param", "describe", SET, "--json")
        described = {each["name"]: each for each in json.loads(said)["parameters"]}
        assert (described["speed"]["unit"], described["speed"]["high"]) == ("m/s", 0.5)
        commands.until(0.3, 0.2)
        assert mine.stop() == 0

        network.run(file, "--namespace", "tb3_0")
        commands.until(0.3, 0.0)
        status, said = elea(network, "param", "get", SET)
        (line,) = (each for each in said.splitlines() if "speed" in each)
        assert (status, "0.3" in line, "saved" in line) == (0, True, True), said


class Commands:
    """Receives the controller's commands."""

    def __init__(self, node: Node) -> None:
        self._node, self._commands = node, node.subscribe(CMD_VEL, "/tb3_0/cmd_vel")
        self._last = 0.0, 0.0

    def until(self, speed: float, turn: float) -> None:
        """Wait until it commands these velocities."""

        def there() -> bool:
            self._node.update_subscribers()
            for command, _ in self._commands.messages:
                self._last = command.linear.x, command.angular.z
            return self._last == (speed, turn)

        wait_until(there, 30.0, f"the command {speed} m/s, {turn} rad/s")
