"""Efforts from a controller process: identical bit for bit in lockstep, and released when it is killed."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path

import pytest

from messages.sensor import JointState
from messages.topics import JOINT_STATES
from services.runtime.step import STEP_NS
from tests.harness.cases import case
from tests.harness.message_recorder import WITHIN_S, MessageRecorder
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until
from tests.services.sim.joints.pd_controller import __file__ as PD

NODE = "/arm/pd"
MODES = ("lockstep", "real")


@contextmanager
def arm(logs: Path, **settings: object) -> Iterator[tuple[Process, MessageRecorder[JointState]]]:
    """Run the arm and its controller; yield the controller's process and a recorder of joint states."""
    logs.mkdir(exist_ok=True)
    lockstep = ["--lockstep"] if settings["mode"] == "lockstep" else []
    given = {"robots": [{"name": "arm", "model": "arm"}], "members": [NODE] if lockstep else [], **settings}
    words = [word for name, value in given.items() for word in ("--param", f"{name}={json.dumps(value)}")]
    with Network(logs) as network, network.node() as node:
        states = MessageRecorder(node.subscribe(JOINT_STATES, "/arm/joint_states"))
        network.start("sim", *words)
        yield network.run(Path(PD), "--namespace", "/arm", *lockstep), states


def by_stamp(states: MessageRecorder[JointState]) -> dict[int, tuple[float, float]]:
    """Return angle [deg] and effort [N m] by stamp [ns] of what has been received so far."""
    return {each.header.stamp.ns: (math.degrees(each.position[0]), each.effort[0]) for each in states.received()}


def test_lockstep_repeats_bit_for_bit(tmp_path: Path) -> None:
    """Both go on until enough steps of each are known: a busy observer misses some, at other times in each."""
    runs: dict[str, dict[int, tuple[float, float]]] = {"one": {}, "other": {}}

    def common() -> list[int]:
        return sorted(runs["one"].keys() & runs["other"].keys())

    def run(name: str) -> None:
        def enough() -> bool:
            runs[name] = by_stamp(states)
            both = common()
            return len(both) > 300 and both[-1] >= 3 * 10**9

        with arm(tmp_path / name, mode="lockstep", latency=1) as (_, states):
            wait_until(enough, WITHIN_S, "300 steps that both runs have, up to 3 s", every=0.05)

    with ThreadPoolExecutor() as pool:
        list(pool.map(run, runs))
    both = common()
    assert [runs["one"][stamp] for stamp in both] == [runs["other"][stamp] for stamp in both]
    assert runs["one"][both[-1]][0] == pytest.approx(29.626, abs=0.01)


def test_a_killed_controller_lets_go_when_its_last_job_ends(tmp_path: Path) -> None:
    """In both modes, in parallel."""
    with ThreadPoolExecutor() as pool:
        for mode, done in [(each, pool.submit(_kill_a_controller, tmp_path / each, each)) for each in MODES]:
            with case(mode):
                done.result()


def _kill_a_controller(tmp_path: Path, mode: str) -> None:
    with arm(tmp_path, mode=mode) as (controller, states):

        def held() -> bool:
            seen = states.received()
            return bool(seen) and seen[-1].effort[0] != 0.0 and math.degrees(seen[-1].position[0]) > 25.0

        # Not for a simulated time: in real time, it goes on while the controller starts.
        wait_until(held, WITHIN_S, "an arm that the controller holds up")
        controller.kill()

        def fallen() -> bool:
            seen = states.received()
            return seen[-1].effort[0] == 0.0 and math.degrees(seen[-1].position[0]) < 25.0

        wait_until(fallen, WITHIN_S, "an arm that falls")
        seen = by_stamp(states)
        stamps = [stamp for stamp, (_, effort) in seen.items() if effort]
        last = [list(group) for _, group in groupby(stamps, lambda stamp: seen[stamp][1])][-1]
        assert last[-1] - last[0] <= 20 * STEP_NS, "0.1 s from its first step to its last"
        assert all(seen[stamp][1] == 0.0 for stamp in seen if stamp > last[-1])
