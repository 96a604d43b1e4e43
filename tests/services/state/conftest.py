"""Two burgers in a simulation, one with its links published by the service ``state``, and an imported robot."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from messages.topics import JOINT_STATES, TF, TF_STATIC
from services.runtime.node import Node
from services.runtime.tf.listener import TransformListener
from tests.harness.fork_server import run_verb
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until
from tests.services.state.sample_urdfs import GRIPPER

PLACES = {"a": 0.0, "b": 1.0}
"""y of each burger [m]; x is 0."""


class TfHarness:
    """The network, an observing node, and its transform listener."""

    def __init__(self, network: Network, node: Node, sim: Process, state: Process, gripper: Process) -> None:
        self.network, self.node = network, node
        self.sim, self.state, self.gripper = sim, state, gripper
        node.subscribe(JOINT_STATES, "/a/joint_states")
        self.frames = TransformListener(node)
        wait_until(lambda: self.poll().can("world", "a/wheel_left_link"), 40.0, "the frames of a")
        wait_until(lambda: self.poll().can("gripper/base", "gripper/nail"), 40.0, "the frames of the gripper")

    def poll(self) -> TransformListener:
        """Return the transform listener, updated with all messages so far."""
        self.node.update_subscribers()
        self.frames.refresh()
        return self.frames

    def stamps(self, frame: str) -> list[int]:
        """Return the stamps [ns] of a moving frame since the last poll."""
        moving = self.node.subscribe(TF)
        self.node.update_subscribers()
        each_sent = (each for message, _ in moving.messages for each in message.transforms)
        return [each.header.stamp.ns for each in each_sent if each.child_frame_id == frame]

    def run_command(self, *arguments: str, within: float = 60.0) -> subprocess.CompletedProcess[str]:
        """Run a command on this network to its end."""
        return run_verb(*arguments, "--connect", self.network.endpoint, within=within)

    def run_together(self, *commands: tuple[str, ...]) -> list[subprocess.CompletedProcess[str]]:
        """Run commands in parallel to their ends, as most of them mainly listen."""
        with ThreadPoolExecutor(len(commands)) as pool:
            return list(pool.map(lambda words: self.run_command(*words), commands))


@pytest.fixture(scope="package")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TfHarness]:
    logs: Path = tmp_path_factory.mktemp("state")
    urdf = logs / "gripper.urdf"
    urdf.write_text(GRIPPER)
    parameters = {"a": {"enable_link_tf": False, "odometry": "world"}, "b": {"odometry": "world"}}
    robots = [{"name": name, "model": "burger", "y": y, "parameters": parameters[name]} for name, y in PLACES.items()]
    with Network(logs) as network, network.node() as node:
        sim = network.start("sim", "--param", f"robots={json.dumps(robots)}", "--param", "mode=real")
        state = network.start("state", "--namespace", "/a")
        own = ("--param", f"urdf={urdf}", "--param", "publish_default_positions=true")
        gripper = network.start("state", "--namespace", "/gripper", *own)
        for topic in (TF, TF_STATIC):
            node.subscribe(topic)
        yield TfHarness(network, node, sim, state, gripper)
