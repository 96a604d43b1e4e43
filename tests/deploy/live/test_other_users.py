"""Another user of the machine can neither receive from nor drive the robots of a fleet."""

from __future__ import annotations

import json
from pathlib import Path

import psutil

from services.runtime.transport.unix_sockets import path_of
from tests.harness.background_fleet import BackgroundFleet
from tests.harness.other_user import run_as_other_user


def test_no_other_user_comes_in(running: BackgroundFleet) -> None:
    [fleet] = json.loads(running.command_line.run("ps", "--json").out)
    assert fleet["listen"] == []
    router = path_of(fleet["router"])
    supervisor = psutil.Process(fleet["pid"])
    family = [supervisor, *supervisor.children(recursive=True)]
    inet = [each for one in family for each in one.net_connections("inet") if each.status == psutil.CONN_LISTEN]
    assert inet == [], "nobody listens on a port"
    unix = {each.laddr for one in family for each in one.net_connections("unix") if each.laddr}
    listening = {line.split()[-1] for line in _unix() if line.split()[-1] in unix}
    assert str(router) in listening
    assert len(listening) == len(fleet["processes"]) + 1, "each of the fleet, and the supervisor"
    assert {Path(each).parent for each in listening} == {router.parent}

    tcp = f"tcp/127.0.0.1:{running.command_line.port}"
    with run_as_other_user(fleet["router"], sorted(listening)) as program, run_as_other_user(tcp) as other:
        out, err = program.communicate(timeout=60)
        assert "out: Unable to connect" in other.communicate(timeout=60)[1]
    assert out.split() == ["PermissionError"] * len(listening)
    assert program.returncode == 1
    assert "out: Unable to connect" in err


def _unix() -> list[str]:
    """Return the lines of this machine's listening Unix sockets (flag SO_ACCEPTCON)."""
    lines = Path("/proc/net/unix").read_text().splitlines()[1:]
    return [line for line in lines if line.split()[3] == "00010000"]
