"""Message sizes for three hundred robots: no message that grows with the fleet exceeds its limit; no physics runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from deploy.fleet import Fleet
from deploy.processes import ProcessSpec, plan_processes
from deploy.service_parameters import RunOptions
from deploy.supervisor.supervisor import Supervisor
from messages.base import decoder, encode
from messages.elea import FleetState, Health
from messages.gazebo import LinkStates, ModelStates
from messages.records import RECORDS
from messages.se3 import Pose3
from messages.std import Empty
from messages.tf import TFMessage
from messages.topics import (
    BASE_STATUS,
    CMD_VEL,
    DESCRIPTIONS,
    FLEET_STATE,
    GROUND_TRUTH,
    HEALTH,
    LINK_STATES,
    MODEL_STATES,
    ODOM,
    PLAN,
    STATUS,
    TF,
    TF_STATIC,
    TOPICS,
    UPDATES,
)
from models.urdf import read_joints
from models.world import WorldDescription
from services.grader.measurement import MessageLosses
from services.recorder import RecorderParameters
from services.recorder.subscriptions import Subscriptions, TopicFilter
from services.runtime.node import Node
from services.runtime.step import STEP_NS
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE
from services.sim.engines import open_world
from services.sim.parameters import RobotEntry
from services.sim.services import SimulationServices
from services.sim.simulation import TF_STEPS, Simulation
from tests.harness.memory_node import memory_node

ROBOTS = 300
NAMES = [f"robot_{number:03}" for number in range(ROBOTS)]
BEATS = 24
"""Number of heartbeats within which a node of any size has reported all its topics."""
LONGEST_ARGUMENT = 1 << 17
"""Longest command line argument [bytes]: Linux's MAX_ARG_STRLEN."""


class Network:
    """An in-memory bus, and all messages on it since the last call of ``sent``."""

    def __init__(self) -> None:
        self.bus = MemoryBus()
        self._inlet = MemoryTransport(self.bus).subscribe("**", 1 << 20)

    def sent(self) -> list[tuple[str, Any, int]]:
        """Return key, record and size of each new sample; assert that each decodes and keeps its topic's limit."""
        found = []
        for payload, _, (encoding, key) in iter(self._inlet.recv, None):
            record = RECORDS[encoding.partition(";")[2]]
            topic = next(each for each in TOPICS if each.record is record and f"/{key}".endswith(each.name.strip("~")))
            assert len(payload) <= topic.largest, f"{key}: {len(payload)} bytes"
            found.append((key, decoder(record)(payload), len(payload)))
        return found

    def beats(self, of: Node, count: int = BEATS) -> list[Health]:
        """Return the next heartbeats of a node."""
        self.sent()
        for _ in range(count):
            of.heartbeat.request_now()
            of.spin_once()
        return [record for key, record, _ in self.sent() if key == HEALTH.name[1:]]


@pytest.fixture(scope="module")
def network() -> Network:
    return Network()


@pytest.fixture(scope="module")
def simulation_and_node(network: Network) -> Iterator[tuple[Simulation, Node]]:
    """Three hundred burgers at rest, two metres apart; their messages are the same with each physics engine."""
    with (
        memory_node(network.bus, "sim") as simulation,
        open_world("mujoco", WorldDescription(), STEP_NS) as world,
    ):
        made = Simulation(simulation, world, 0)
        tell, made.publish_static_tf = made.publish_static_tf, lambda: None  # type: ignore[method-assign]
        for number, name in enumerate(NAMES):
            made.spawn(RobotEntry(name=name, model="burger"), Pose3((number % 20 * 2.0, number // 20 * 2.0, 0.0)))
        made.publish_static_tf = tell  # type: ignore[method-assign]
        yield made, simulation


def whole(beats: list[Health], of: Node) -> None:
    """Assert that these heartbeats report all topics of a node and its totals."""
    told = {each.topic for beat in beats for each in (*beat.inputs, *beat.outputs)}
    assert told == {each.name for each in (*of.subscribers, *of.publishers)}
    assert (beats[-1].reads, beats[-1].writes) == (len(of.subscribers), len(of.publishers))


@pytest.mark.slow
def test_what_the_simulation_tells(network: Network, simulation_and_node: tuple[Simulation, Node]) -> None:
    made, simulation = simulation_and_node
    with memory_node(network.bus, "reader") as reader:
        inputs = {topic: reader.subscribe(topic) for topic in (TF, TF_STATIC, MODEL_STATES, LINK_STATES)}
        network.sent()
        made.publish_static_tf()
        made.tick = 40 * TF_STEPS  # all topics are due
        made.publish()
        sizes = [(size, key) for key, _, size in network.sent()]
        assert len(sizes) > 5 * ROBOTS
        reader.update_subscribers()
        assert not any(each.refused or each.lost for each in inputs.values())
        moving = [each.child_frame_id for message, _ in inputs[TF].messages for each in message.transforms]
        assert len(moving) == len(set(moving)) == 3 * ROBOTS
        assert {name.partition("/")[0] for name in moving} == set(NAMES)
        assert len(inputs[TF].messages) > 3, "it is no single message"
        (fixed, _), *rest = inputs[TF_STATIC].messages
        assert (type(fixed), rest) == (TFMessage, [])
        assert len({each.child_frame_id for each in fixed.transforms}) >= 5 * ROBOTS
        (models, _), (links, _) = inputs[MODEL_STATES].messages[0], inputs[LINK_STATES].messages[0]
        assert isinstance(models, ModelStates)
        assert isinstance(links, LinkStates)
        assert models.name == tuple(NAMES)
        assert len(links.name) >= 7 * ROBOTS
    listed = SimulationServices(made, simulation)._list(Empty())
    assert len(listed.models) == ROBOTS
    assert len(encode(listed)) < LARGEST_MESSAGE // 8


def test_the_largest_model_three_hundred_times() -> None:
    """Limits hold for the static frames and links of as many Pioneers, which have more than three times a burger's."""
    frames, burger = len(read_joints("p3dx")) + 1, len(read_joints("burger")) + 1
    assert TF_STATIC.largest > 250 * frames * ROBOTS
    assert LINK_STATES.largest > 400 * frames * ROBOTS
    assert frames > 3 * burger


@pytest.mark.slow
def test_heartbeats_of_the_simulation_and_a_loss_in_the_last_robot(
    network: Network, simulation_and_node: tuple[Simulation, Node]
) -> None:
    simulation = simulation_and_node[1]
    beats = network.beats(simulation)
    whole(beats, simulation)
    losses = MessageLosses(("/sim",))
    last = next(each for each in simulation.subscribers if each.name == f"/{NAMES[-1]}/{CMD_VEL.name}")
    last.lost, last.refused, last.reason = 7, 1, "x" * 200
    (beat,) = network.beats(simulation, 1)
    losses.add_heartbeat(beat)
    assert (beat.lost, beat.refused) == (7, 1)
    assert (losses.total_losses(), losses.robot_losses(NAMES[-1]), losses.robot_losses(NAMES[0])) == (7, 7, 0), (
        "new trouble is told at once"
    )
    for each in simulation.subscribers:
        each.lost, each.reason = each.lost + 1, "\u20ac" * 200
    for beat in network.beats(simulation, 2 * BEATS):
        losses.add_heartbeat(beat)
    assert losses.total_losses() == len(simulation.subscribers) + 7
    for name in NAMES:
        assert losses.robot_losses(name) == sum(
            each.lost for each in simulation.subscribers if each.name.startswith(f"/{name}/")
        )


@pytest.mark.slow
def test_heartbeats_of_a_recorder_a_grader_a_panel_and_the_parameter_service(
    network: Network, simulation_and_node: tuple[Simulation, Node]
) -> None:
    with memory_node(network.bus, "recorder") as recorder:
        resolve = recorder.identity.resolve
        listening = Subscriptions(recorder, TopicFilter(RecorderParameters(), resolve))
        listening.subscribe_existing()
        assert len(recorder.subscribers) > 7 * ROBOTS
        whole(network.beats(recorder), recorder)
    with memory_node(network.bus, "grader") as grader:
        for name in NAMES:
            for topic in (GROUND_TRUTH, ODOM, PLAN, STATUS, BASE_STATUS):
                grader.subscribe(topic, f"/{name}/{topic.name}")
            grader.subscribe(UPDATES, f"/{name}/base/parameter_updates")
        whole(network.beats(grader), grader)
    with memory_node(network.bus, "params") as params:
        for number in range(1000):
            params.advertise(DESCRIPTIONS, f"/set_{number}/parameter_descriptions")
            params.advertise(UPDATES, f"/set_{number}/parameter_updates")
        whole(network.beats(params), params)


def test_a_beat_that_cannot_be_told_tells_totals(network: Network) -> None:
    with memory_node(network.bus, "odd") as odd:
        source = odd.subscribe(CMD_VEL)
        source.received, source.lost = 5, 2**70
        (beat,) = network.beats(odd, 1)
        assert (beat.node, beat.received, beat.lost, beat.inputs) == ("/odd", 5, 2**63 - 1, ())
        source.lost, source.reason = 0, "\ud800"
        (beat,) = network.beats(odd, 1)
        assert (beat.received, beat.inputs) == (5, ())
        source.reason = ""
        (beat,) = network.beats(odd, 1)
        assert [each.received for each in beat.inputs] == [5]


@pytest.mark.slow
def test_the_state_of_the_fleet_and_its_command_lines() -> None:
    robots = "".join(
        f'[[robot]]\nname = "{name}"\nmodel = "burger"\npose = {{ x = {i}.5, y = 1.25 }}\n'
        for i, name in enumerate(NAMES)
    )
    text = f"""name = "large"\n[run]\nmode = "lockstep"\n{robots}
[[every_robot]]\nkind = "waypoint"\n[every_robot.parameters]\ngoals = [[1, 0]]
[[service]]\nkind = "panel"\n[[service]]\nkind = "recorder"\n[[service]]\nkind = "logger"\n"""
    planned: tuple[ProcessSpec, ...] = plan_processes(
        msgspec.toml.decode(text, type=Fleet), RunOptions(folder=Path("/tmp/results"))
    )
    assert len(planned) > ROBOTS
    words = [(len(word.encode()), each.name, word[:60]) for each in planned for word in each.argv]
    assert max(words)[0] < LONGEST_ARGUMENT, max(words)
    supervisor = Supervisor("large", "lockstep", planned, None, None, None)  # type: ignore[arg-type]
    for life in supervisor.processes.values():
        life.state, life._reason = "backing off", "exit status 1: " + "x" * 300
    told = encode(supervisor.state())
    assert len(told) <= FLEET_STATE.largest
    assert len(decoder(FleetState)(told).processes) == len(planned)
