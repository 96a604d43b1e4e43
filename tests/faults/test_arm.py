"""Faults of the arm: its controller or its reference is killed while it follows a sine in real time."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from messages.joints import JointEffort
from messages.parameters import Assignment, SetParameters
from messages.requests import PARAMS_SET
from messages.sensor import JointState
from messages.topics import JOINT_EFFORT, JOINT_STATES, REFERENCE
from services.runtime.node import Node
from tests.faults.conftest import FleetSlot
from tests.faults.supervised_fleet import START_S, SupervisedFleet

DURATION_S = 0.1
"""Duration [s] of an effort from the controller."""
PATIENCE_S = 1.0
STEP_S = 0.005
"""The physics step [s]; a job acts on every step from its start to its end, both included."""

ARM = f"""
name = "arm_faults"

[run]
mode = "real"
ends = "never"

[[robot]]
name = "arm"
model = "arm"

[[robot.services]]
kind = "arm"
parameters = {{ controller_type = "tr", duration = {DURATION_S} }}

[[robot.services]]
kind = "reference"
restart = "never"
parameters = {{ reference_type = "sine", sin_ref_gain = 30.0, sin_ref_f = 0.5 }}
"""


class ArmRecorder:
    """Records the joint's states, its effort jobs and the references."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._joints = node.subscribe(JOINT_STATES, "/arm/joint_states")
        self._efforts = node.subscribe(JOINT_EFFORT, "/arm/joint_effort")
        self._references = node.subscribe(REFERENCE)
        self.joints: list[JointState] = []
        self.jobs: list[JointEffort] = []
        self.references: list[float] = []

    def look(self) -> None:
        """Read new messages."""
        for each in (self._joints, self._efforts, self._references):
            each.update()
        self.joints += [state for state, _ in self._joints.messages]
        self.jobs += [job for job, _ in self._efforts.messages]
        self.references += [reference.data for reference, _ in self._references.messages]

    @property
    def angle(self) -> float:
        """The joint's latest angle [deg]."""
        return math.degrees(self.joints[-1].position[0])

    @property
    def time(self) -> float:
        """The latest simulation time [s]."""
        return self.joints[-1].header.stamp.ns / 1e9


@pytest.fixture(scope="module")
def swinging(
    fleet_slot: FleetSlot, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[SupervisedFleet, ArmRecorder]]:
    fleet_slot.stop()  # no other fleet runs beside it
    with SupervisedFleet(ARM, 0, tmp_path_factory.mktemp("arm")) as fleet, fleet.node("witness") as node:
        witness = ArmRecorder(node)
        fleet.wait_ready(within=START_S)
        follows(fleet, witness)
        yield fleet, witness


def follows(fleet: SupervisedFleet, witness: ArmRecorder) -> None:
    """Wait until the joint has been near the reference at both ends of its swing."""
    seen: set[int] = set()

    def look() -> bool:
        witness.look()
        if witness.references and witness.joints and abs(witness.angle - witness.references[-1]) < 3.0:
            seen.update({math.copysign(1, witness.angle)} if abs(witness.angle) > 25.0 else ())
        return seen == {1, -1}

    fleet.wait(look, "a joint that follows its reference", within=START_S)


def test_a_killed_controller_lets_the_joint_go_within_its_last_job(
    swinging: tuple[SupervisedFleet, ArmRecorder],
) -> None:
    fleet, witness = swinging
    before = fleet.process("arm/arm")
    fleet.kill("arm/arm")
    begin = witness.time

    def fallen() -> bool:
        witness.look()
        return witness.time > begin + 2 * DURATION_S

    fleet.wait(fallen, "the joint without a controller")
    times = [job.start_time.ns / 1e9 for job in witness.jobs if job.start_time.ns / 1e9 > begin - DURATION_S]
    gaps = zip(times, [*times[1:], math.inf], strict=True)
    start, back = next((last, next_) for last, next_ in gaps if next_ - last > DURATION_S)
    end = min(witness.time, back)  # the next controller may already be running
    after = [(state.header.stamp.ns / 1e9, state.effort[0]) for state in witness.joints[-100:]]
    acting = [time for time, effort in after if effort]
    free = [effort for time, effort in after if start + DURATION_S + 2 * STEP_S < time <= end]
    assert free, "nothing was seen of the joint after the job"
    assert set(free) == {0.0}, "no effort acts when the job is over"
    assert acting[-1] >= start, "and it does act until then"

    fleet.wait_restarted(before)
    follows(fleet, witness)
    assert "killed by signal 9" in fleet.log("arm/arm")


def test_a_killed_reference_is_held_and_said(swinging: tuple[SupervisedFleet, ArmRecorder]) -> None:
    """Efforts act longer here, so that a controller that briefly gets no processor doesn't release the joint."""
    fleet, witness = swinging
    patient = (Assignment(name="duration", value=PATIENCE_S), Assignment(name="state_timeout", value=PATIENCE_S))
    witness.node.call(PARAMS_SET, SetParameters(set="/robot_control", values=patient, run=True, who="test"))
    fleet.kill("arm/reference")
    fleet.wait(lambda: "no reference for" in fleet.log("arm/arm"), "the controller to say so")
    witness.look()
    held, since = witness.references[-1], witness.time

    def later() -> bool:
        witness.look()
        return witness.time > since + 1.5

    fleet.wait(later, "a while more")
    angles = [math.degrees(s.position[0]) for s in witness.joints if s.header.stamp.ns / 1e9 > since + 1.0]
    assert max(angles) - min(angles) < 0.3, "it stands"
    assert all(abs(angle - held) < 0.6 for angle in angles), "where the last reference was"
    assert f"holding {held:.2f} deg: is its service still running?" in fleet.log("arm/arm")
    assert fleet.process("arm/arm").state == "ready"
