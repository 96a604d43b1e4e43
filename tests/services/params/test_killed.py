"""The parameter service killed while setting, at 20 random instants: clients can find out whether a set was applied."""

from __future__ import annotations

import random
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from services.runtime.errors import CallFailed
from tests.harness.processes import Network, Process
from tests.services.params.parameter_client import (
    ParameterTestClient,
    arm_announcement,
    connected_client,
    start_and_wait,
    value_dict,
)

KILLS = 20
LANES = 4
"""Number of services in parallel, each with a file and a domain of its own."""
SEED = 4
UNSET = 37.5, 38.5
TIMEOUT_S = 1.0
"""Wall time [s] that a client waits for the answer of a service that may be killed."""
WITHIN_S = 0.04
"""Longest wall time [s] from the start of a burst to the kill."""


def burst(client: ParameterTestClient, process: Process, chance: random.Random, number: int) -> tuple[int, int]:
    """Set increasing numbers until the service dies; return the last acknowledged one and the pending one."""
    delay = chance.uniform(0.0, WITHIN_S)
    go = threading.Event()

    def kill() -> None:
        go.wait()
        time.sleep(delay)
        process.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    acknowledged, hasty = number, ParameterTestClient(client.transport, TIMEOUT_S)
    try:
        while True:
            number += 1
            go.set()
            answer = value_dict(hasty.set(request=f"n{number}", ss_Kp=number / 100, tr_Kp=number / 100))
            assert answer["ss_Kp"] == answer["tr_Kp"] == number / 100
            acknowledged = number
    except CallFailed as error:
        if not any(part in str(error) for part in ("did not answer", "no server for")):
            raise
    finally:
        killer.join()
    return acknowledged, number


def lane(network: Network, file: Path, index: int) -> dict[str, int]:
    """Kill services on one file in turn; return how often the pending set had been applied or lost."""
    chance = random.Random(f"{SEED} {index}")
    seen = {"applied": 0, "lost": 0}
    on_its_way = acknowledged = 0
    domain = f"lane{index}"
    with connected_client(network, domain) as client:
        for _ in range(KILLS // LANES + 1):
            process = start_and_wait(network, client, file, "--domain", domain)
            found = value_dict(client.announce(arm_announcement()))
            if on_its_way:
                pair = found["ss_Kp"], found["tr_Kp"]
                new, old = (on_its_way / 100,) * 2, (acknowledged / 100,) * 2 if acknowledged else UNSET
                assert pair in (new, old), "mixed, or an acknowledged one was lost"
                seen["applied" if pair == new else "lost"] += 1
                again = value_dict(
                    client.set_with_retry(request=f"n{on_its_way}", ss_Kp=on_its_way / 100, tr_Kp=on_its_way / 100)
                )
                assert again["ss_Kp"] == on_its_way / 100
            acknowledged, on_its_way = burst(client, process, chance, on_its_way)
        process = start_and_wait(network, client, file, "--domain", domain)
        client.announce(arm_announcement())
        changes = [each for each in client.history() if each.kind == "set"]
        numbers = [round(plain_after(each.after) * 100) for each in reversed(changes)]
    applied = numbers[-1]
    assert applied in (acknowledged, on_its_way)
    assert numbers == list(range(1, applied + 1)), "one was applied twice, or an acknowledged one was lost"
    process.kill()
    return seen


def plain_after(after: tuple) -> float:  # type: ignore[type-arg]
    (value,) = {each.value for each in after}
    return float(value)


def test_20_kills_lose_nothing_that_was_acknowledged(tmp_path: Path) -> None:
    with Network(tmp_path) as network, ThreadPoolExecutor(LANES) as pool:
        lanes = [pool.submit(lane, network, tmp_path / f"{index}.db", index) for index in range(LANES)]
        seen = [each.result() for each in lanes]
    kills = sum(sum(each.values()) for each in seen)
    assert kills >= KILLS
    assert sum(each["applied"] for each in seen) > 0, seen
    assert sum(each["lost"] for each in seen) > 0, seen
