"""Invalid requests: each gets an error reply with the reason and has no effect."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgpack
import pytest
import zenoh

from messages.geometry import Point, Pose, Quaternion
from messages.requests import DELETE, GET_STATE, LIST, PAUSE, RESET, RESET_WORLD, RESUME, SET_STATE, SPAWN, STEP, Name
from messages.simulation import ModelList, SetModelState, SpawnModel
from messages.std import Empty
from services.runtime.errors import CallFailed
from tests.harness.external_client import error_reason, external_client
from tests.system.two_robot_simulation import TwoRobotSimulation, two_robot_simulation

ALL = (SPAWN, DELETE, LIST, GET_STATE, SET_STATE, RESET, RESET_WORLD, PAUSE, RESUME, STEP)
GARBAGE = {"no payload": None, "nothing": b"", "noise": b"\xc1\xff", "a list": b"\x90", "1 MB": b"\xdb" * 1_000_000}
WRONG: dict[str, tuple[str, Any, str]] = {
    "a name that is a number": ("sim/delete", {"name": 5}, "name"),
    "a count in text": ("sim/step", {"count": "5"}, "count"),
    "no steps": ("sim/step", {"count": 0}, "count"),
    "steps without end": ("sim/step", {"count": 10**9}, "count"),
    "a place that is NaN": ("sim/spawn", {"name": "a", "model": "burger", "pose": {"position": {"x": math.nan}}}, "x"),
    "a place at 1e308": ("sim/set_state", {"name": "tb3_0", "pose": {"position": {"x": 1e308}}}, "x"),
    "a place in text": ("sim/set_state", {"name": "tb3_0", "pose": "here"}, "pose"),
}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoRobotSimulation]:
    with two_robot_simulation(tmp_path_factory.mktemp("requests")) as made:
        yield made


@pytest.fixture(scope="module")
def session(running: TwoRobotSimulation) -> Iterator[zenoh.Session]:
    with external_client(running.network.endpoint) as made:
        yield made


@pytest.fixture(autouse=True)
def _nothing_is_done(running: TwoRobotSimulation) -> Iterator[None]:
    """Assert that robots and their poses are unchanged, and that time continues in the same epoch."""
    before = models(running)
    truth = running.truth["tb3_0"].wait_next()
    yield
    for one, other in zip(before.models, models(running).models, strict=True):
        assert (one.name, one.model) == (other.name, other.model)
        assert one.pose.position.x == pytest.approx(other.pose.position.x, abs=1e-4)
        assert one.pose.position.y == pytest.approx(other.pose.position.y, abs=1e-4)
    assert running.truth["tb3_0"].wait_after(0.1).header.stamp.ns > truth.header.stamp.ns
    assert running.sim.status is None


def models(running: TwoRobotSimulation) -> ModelList:
    return running.call(LIST, Empty())


@pytest.mark.parametrize("request_", ALL, ids=lambda each: each.name)
def test_garbage(session: zenoh.Session, request_: Any) -> None:
    for what, payload in GARBAGE.items():
        reason = error_reason(session, request_.name[1:], payload)
        assert len(reason) > 10, what
        assert "internal" not in reason


@pytest.mark.parametrize("what", WRONG)
def test_wrong_fields_are_named(session: zenoh.Session, what: str) -> None:
    key, asked, field = WRONG[what]
    assert f"{field}`" in error_reason(session, key, msgpack.packb(asked))


@pytest.mark.parametrize("key", ["sim/*", "**", "*/pause", "sim/re$*"])
def test_a_request_to_a_wildcard_is_meant_for_nobody(session: zenoh.Session, key: str) -> None:
    for payload in (b"\x80", None):
        replies = list(session.get(key, payload=payload, timeout=60.0))
        assert [reply for reply in replies if reply.ok is not None] == []


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        ({"name": "x", "model": "burger"}, r"'x' at x 0\.000 m, .* would overlap with 'tb3_0' by 0\.\d+ m"),
        ({"name": "x", "model": "waffle", "pose": Pose.planar(0.1, 0.7)}, "would overlap with 'tb3_1'"),
        ({"name": "x", "model": "burger", "pose": Pose(position=Point(x=3.0, z=-0.05))}, "overlap with the ground"),
        ({"name": "tb3_0", "model": "burger", "pose": Pose.planar(5, 5)}, "already a robot 'tb3_0'"),
        (
            {"name": "x", "model": "burgr"},
            r"unknown model 'burgr'; did you mean 'burger'\? \(known: arm, arm_corrected, burger, ",
        ),
        ({"name": "x", "model": "../../etc"}, "outside the folders from which a request may read files"),
        ({"name": "", "model": "burger"}, "name"),
        ({"name": "a*", "model": "burger"}, "wildcards are not allowed"),
        ({"name": "3x", "model": "burger"}, "does not start with a digit"),
        ({"name": "x", "model": "burger", "namespace": "**"}, "wildcards are not allowed"),
        ({"name": "@elea", "model": "burger"}, "letters, digits"),
        (
            {"name": "x", "model": "burger", "pose": Pose(position=Point(x=9), orientation=Quaternion(w=0.0))},
            "not a rotation",
        ),
    ],
)
def test_spawns_that_cannot_be(running: TwoRobotSimulation, asked: dict[str, Any], reason: str) -> None:
    with pytest.raises(CallFailed, match=reason):
        running.call(SPAWN, SpawnModel(**asked))


def test_models_that_are_not_there(running: TwoRobotSimulation) -> None:
    for request, message in (
        (DELETE, Name(name="tb3_9")),
        (GET_STATE, Name(name="tb3_9")),
        (SET_STATE, SetModelState(name="tb3_9")),
    ):
        with pytest.raises(CallFailed, match=r"unknown model 'tb3_9'; did you mean 'tb3_[01]'"):
            running.call(request, message)


def test_a_state_that_overlaps(running: TwoRobotSimulation) -> None:
    with pytest.raises(CallFailed, match=r"'tb3_0' at .* would overlap with 'tb3_1'"):
        running.call(SET_STATE, SetModelState(name="tb3_0", pose=Pose.planar(0.0, 0.45)))
