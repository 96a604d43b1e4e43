"""One fleet per port: the error names the port's owner, and a dead supervisor leaves no lock."""

from __future__ import annotations

import fcntl
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from deploy.instance_lock import check_parameter_file_unused, instance_lock
from deploy.run_folder import make_run_folder
from services.runtime.errors import BadInput
from services.runtime.fleet_instances import FleetInstance, running_fleets
from services.runtime.process import ROOT
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from services.runtime.user_folders import instances_folder
from tests.harness.ports import free_port

HOLDER = """
import sys, time
from deploy.instance_lock import instance_lock
from services.runtime.fleet_instances import FleetInstance
entry = FleetInstance(fleet="other", mode="real", port=int(sys.argv[1]), pid=0, folder="/x", started="today")
with instance_lock(entry):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """A free port, with an empty state folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return free_port()


def entry(port: int) -> FleetInstance:
    return FleetInstance(fleet="mine", mode="real", port=port, pid=os.getpid(), folder="/runs/1", started="now")


def hold(port: int) -> subprocess.Popen[str]:
    """Start another process that locks the port."""
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(port)], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    return holder


def test_a_fleet_is_listed_as_long_as_it_runs(port: int) -> None:
    with instance_lock(entry(port)):
        assert running_fleets() == (entry(port),)
    assert running_fleets() == ()


def test_another_fleet_is_named(port: int) -> None:
    with hold(port) as holder:
        try:
            with (
                pytest.raises(BadInput, match=rf"port {port} is held by the fleet other .* --port"),
                instance_lock(entry(port)),
            ):
                pass
        finally:
            holder.kill()


def test_a_killed_supervisor_holds_nothing_although_its_file_is_there(port: int) -> None:
    with hold(port) as holder:
        assert [each.fleet for each in running_fleets()] == ["other"]
        holder.kill()
    assert (instances_folder() / f"{port}.json").exists()
    assert running_fleets() == ()
    with instance_lock(entry(port)):
        assert running_fleets() == (entry(port),)


def test_another_program_on_the_port(port: int) -> None:
    open_to_all = replace(entry(port), listen=(f"tcp/127.0.0.1:{port}",))
    with socket.create_server(("127.0.0.1", port)):
        with (
            pytest.raises(BadInput, match=f"port {port} of 127.0.0.1 is held by another program"),
            instance_lock(open_to_all),
        ):
            pass
        with instance_lock(entry(port)):
            assert running_fleets() == (entry(port),), "without TCP, the port is but a name"
    assert running_fleets() == ()


def test_a_router_that_no_fleet_has_started(port: int) -> None:
    with (
        ZenohTransport(configuration("router", listen=(router_endpoint(port),))),
        pytest.raises(BadInput, match=r"a router that belongs to no fleet already listens in .* --port"),
        instance_lock(entry(port)),
    ):
        pass


def test_an_address_that_is_not_of_this_machine(port: int) -> None:
    away = replace(entry(port), listen=(f"tcp/192.0.2.1:{port}",))
    with pytest.raises(BadInput, match=f"the router cannot listen on tcp/192.0.2.1:{port}"), instance_lock(away):
        pass


def test_state_folder_that_cannot_be_made(port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    with pytest.raises(BadInput, match="set ELEA_HOME"), instance_lock(entry(port)):
        pass


def test_damaged_entry_is_no_fleet(port: int) -> None:
    with instance_lock(entry(port)):
        for damaged in (b"{", b'{"fleet": "\xe5"}'):
            (instances_folder() / f"{port}.json").write_bytes(damaged)
            assert running_fleets() == ()


def test_one_that_is_free_or_not_there_yet_is_taken(tmp_path: Path) -> None:
    check_parameter_file_unused(tmp_path / "new.db")
    (tmp_path / "old.db").touch()
    check_parameter_file_unused(tmp_path / "old.db")


@pytest.mark.slow
def test_one_that_another_parameter_service_holds_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "held.db"
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        with pytest.raises(BadInput, match=r"another parameter service uses .*held\.db.*--params FILE, or --no-saved"):
            check_parameter_file_unused(file)
    finally:
        os.close(descriptor)
    check_parameter_file_unused(file)


def test_the_folder_of_a_running_fleet_is_not_emptied(port: int, tmp_path: Path) -> None:
    folder = make_run_folder("mine", str(tmp_path / "out"))
    kept = [folder / each for each in ("stops.json", "processes.json", "logs/sim.log", "bag/a.mcap")]
    for each in kept:
        each.parent.mkdir(exist_ok=True)
        each.touch()
    (tmp_path / "link").symlink_to(folder)
    with instance_lock(replace(entry(port), folder=str(folder))):
        for report in (folder, tmp_path / "link"):
            with pytest.raises(BadInput, match=rf"running fleet mine .* \./elea down --port {port}, .*--report"):
                make_run_folder("other", str(report))
        assert all(each.exists() for each in kept)
        assert make_run_folder("other", str(tmp_path / "another")) == tmp_path / "another"
    make_run_folder("other", str(folder))
    assert not any(each.exists() for each in kept)
