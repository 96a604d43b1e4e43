"""The parameter service as a process: concurrent clients, rejected files, and a full disk."""

from __future__ import annotations

import json
import resource
from pathlib import Path

import pytest

from messages.topics import UPDATES
from services.runtime.errors import CallFailed
from tests.harness.message_recorder import WITHIN_S, MessageRecorder
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until
from tests.services.params.concurrent_client import PARAMETER_OF_CLIENT
from tests.services.params.parameter_client import (
    arm_announcement,
    connected_client,
    start_and_wait,
    start_service,
    value_dict,
)

pytestmark = pytest.mark.waits

CLIENTS, EACH = 4, 100
SET = "/robot_control"


def test_400_sets_of_four_clients_at_once_lose_none_and_end_in_one_state(network: Network, tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    with connected_client(network, "crowd") as client, network.node(domain="crowd") as early:
        process = start_and_wait(network, client, file, "--domain", "crowd")
        client.announce(arm_announcement())
        follower = MessageRecorder(early.subscribe(UPDATES, f"{SET}/parameter_updates"))
        words = ["-m", "tests.services.params.concurrent_client", network.endpoint]
        crowd = [Process([*words, str(index), str(EACH)], tmp_path / f"{index}.log") for index in range(CLIENTS)]
        assert [each.wait(240.0) for each in crowd] == [0] * CLIENTS, [each.text for each in crowd]
        acknowledged = [json.loads(each.text.splitlines()[-1]) for each in crowd]
        changes = client.history()
        assert len(changes) == CLIENTS * EACH
        assert len({each.revision for each in changes}) == CLIENTS * EACH
        senders = [one.name for each in changes for one in each.after if one.name in PARAMETER_OF_CLIENT]
        assert len(set(senders[EACH : 2 * EACH])) > 1, "they were at it at the same time"
        for own, values in zip(PARAMETER_OF_CLIENT, acknowledged, strict=True):
            kept = [one.value for each in reversed(changes) for one in each.after if one.name == own]
            assert kept == values
            assert len(values) == EACH
        state = client.get()
        wait_until(
            lambda: follower.received() and follower.received()[-1].revision == state.revision, what="the last update"
        )
        assert follower.received()[-1].values == state.values
        assert {each.name: each.value for each in changes[0].after}.items() <= value_dict(state).items()
        with network.node("late", domain="crowd") as late:
            latched = MessageRecorder(late.subscribe(UPDATES, f"{SET}/parameter_updates"))
            wait_until(latched.received, WITHIN_S, "the latched update")
            assert latched.received() == follower.received()[-1:]
        process.kill()
        process = start_and_wait(network, client, file, "--domain", "crowd")
        assert client.announce(arm_announcement()).values == state.values
        process.kill()


def test_a_file_that_is_not_fit_ends_the_service_with_status_2(network: Network, tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    file.write_bytes(b"SQLite format 3\0" + b"x" * 4000)
    refused = start_service(network, file, "--domain", "unfit")
    assert refused.wait(60.0) == 2
    assert "it was left as it is" in refused.text
    assert file.read_bytes() == b"SQLite format 3\0" + b"x" * 4000

    shared = tmp_path / "shared.db"
    with connected_client(network, "unfit") as client:
        first = start_and_wait(network, client, shared, "--domain", "unfit")
        second = start_service(network, shared, "--domain", "elsewhere")
        assert second.wait(60.0) == 2
        assert "another parameter service uses" in second.text
        assert first.status is None
        assert first.stop() == 0


def test_a_full_disk_refuses_and_the_service_lives(network: Network, tmp_path: Path) -> None:
    file = tmp_path / "params.db"
    with connected_client(network, "full") as client:
        process = start_and_wait(network, client, file, "--domain", "full")
        client.announce(arm_announcement())
        before = client.set(ref_angle=10)
        free = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (5000, free[1]))
        for _ in range(3):
            with pytest.raises(CallFailed, match=r"not saved .*nothing was changed: is the disk full"):
                client.set(ref_angle=11)
        assert client.get() == before.__class__(set=SET, revision=before.revision, values=before.values)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, free)
        assert value_dict(client.set(ref_angle=12))["ref_angle"] == 12.0
        process.kill()
        process = start_and_wait(network, client, file, "--domain", "full")
        assert value_dict(client.announce(arm_announcement()))["ref_angle"] == 12.0
        assert [each.after[0].value for each in client.history()] == [12.0, 10.0]
        process.kill()
