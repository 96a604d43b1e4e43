"""Faults of the arm: its controller or its reference is killed while it follows a sine in real time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import pytest

from messages.joints import JointEffort
from messages.parameters import Assignment, SetParameters
from messages.requests import PARAMS_SET
from messages.sensor import JointState
from messages.topics import JOINT_EFFORT, JOINT_STATES, REFERENCE
from services.runtime.node import Node
from tests.faults.conftest import FleetSlot
from tests.faults.supervised_fleet import START_S, WITHIN_S, SupervisedFleet

DURATION_S = 0.1
"""Duration [s] of an effort from the controller."""
PATIENCE_S = 1.0
ENOUGH = 10
"""Number of states in half a second that show whether the joint stands."""
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
restart = {{ first = 1.0 }}
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
    before, seen = fleet.process("arm/arm"), len(witness.jobs)

    def working() -> bool:
        witness.look()
        return len(witness.jobs) > seen

    fleet.wait(working, "a controller at work")
    newest = len(witness.jobs) - 1
    fleet.kill("arm/arm")

    def pauses() -> list[tuple[float, float]]:
        """Return the times [s] of the jobs before and after each pause in which the joint was seen without a job."""
        witness.look()
        times = [job.start_time.ns / 1e9 for job in witness.jobs[newest:]]
        return [each for each in pairwise((*times, math.inf)) if min(each[1], witness.time) > each[0] + 2 * DURATION_S]

    fleet.wait(pauses, "the joint without a controller")
    start, back = pauses()[0]
    end = min(witness.time, back)  # the next controller may already be running
    states = [(state.header.stamp.ns / 1e9, state.effort[0]) for state in witness.joints]
    after = [each for each in states if each[0] > start - DURATION_S]
    acting = [time for time, effort in after if effort]
    free = [effort for time, effort in after if start + DURATION_S + 2 * STEP_S < time <= end]
    assert free, "nothing was seen of the joint after the job"
    assert set(free) == {0.0}, "no effort acts when the job is over"
    assert max(acting, default=0.0) >= start, "and it does act until then"

    fleet.wait_restarted(before)
    follows(fleet, witness)
    assert "killed by signal 9" in fleet.log("arm/arm")


def test_a_killed_reference_is_held_and_said(swinging: tuple[SupervisedFleet, ArmRecorder]) -> None:
    """Efforts act longer here, so that a controller that briefly gets no processor doesn't release the joint."""
    fleet, witness = swinging
    patient = (Assignment(name="duration", value=PATIENCE_S), Assignment(name="state_timeout", value=PATIENCE_S))
    witness.node.call(PARAMS_SET, SetParameters(set="/robot_control", values=patient, run=True, who="test"), WITHIN_S)
    fleet.kill("arm/reference")

    def angles(seconds: float) -> list[float]:
        """Return the angles [deg] of the last seconds."""
        witness.look()
        return [math.degrees(s.position[0]) for s in witness.joints if s.header.stamp.ns / 1e9 > witness.time - seconds]

    def stands() -> bool:
        last = angles(0.5)
        return len(last) > ENOUGH and max(last) - min(last) < 0.3

    def told() -> list[float]:
        """Return the references that the controller says to hold, of the last two: the last may have been sent to one
        of its readers only.
        """
        witness.look()
        log = fleet.log("arm/arm")
        return [r for r in witness.references[-2:] if f"holding {r:.2f} deg: is its service still running?" in log]

    fleet.wait(stands, "a joint that stands")
    since = witness.time
    fleet.wait(told, "the controller to say so")
    held = told()[0]

    def later() -> bool:
        witness.look()
        return witness.time > since + 1.5

    fleet.wait(later, "a while more")
    assert max(angles(1.0)) - min(angles(1.0)) < 0.3, "it stands"
    assert all(abs(angle - held) < 0.6 for angle in angles(1.0)), "where the last reference was"
    assert fleet.process("arm/arm").state == "ready"
