"""Two users run fleets with the same name and port on one machine; a third fleet makes a choice necessary."""

from __future__ import annotations

import json
from pathlib import Path

from tests.harness.command_line import CommandLine
from tests.harness.ports import free_port

FLEET = """
name = "own"
[run]
mode = "real"
ends = "never"
port = {port}
tcp = true
"""


def person(folder: Path, port: int) -> CommandLine:
    """Return a user's command line with a home and a data folder, and a fleet file in its working directory."""
    folder.mkdir()
    made = CommandLine(folder)
    del made.environment["XDG_STATE_HOME"]
    made.environment |= {"HOME": str(folder), "ELEA_HOME": str(folder / "elea")}
    (folder / "own.toml").write_text(FLEET.format(port=port))
    return made


def test_two_people_run_the_same_fleet_at_once(tmp_path: Path) -> None:
    port = free_port()
    anna, ben = (person(tmp_path / name, port) for name in ("anna", "ben"))
    ports = []
    try:
        for each in (anna, ben):
            started = each.run("up", "own.toml", "--detach", "--json", "--no-view", "--no-picture")
            assert started.status == 0, started.err
            assert json.loads(started.out)["folder"].startswith(str(each.folder / "elea/runs"))
            # Every command finds its user's fleet by default.
            (fleet,) = json.loads(each.run("ps", "--json").out)
            assert fleet["folder"] == json.loads(started.out)["folder"]
            (endpoint,) = fleet["listen"]
            ports.append(int(endpoint.rpartition(":")[2]))
            assert each.run("node", "list").status == 0
        assert ports[0] == port
        assert port < ports[1] < port + 100
        log = (Path(fleet["folder"]) / "supervisor.log").read_text()
        assert f"TCP port {port} is held by another program; this fleet takes {ports[1]}" in log

        other = free_port()
        bare = ("--detach", "--no-view", "--no-picture", "--no-saved", "--mode", "real", "--port", str(other))
        second = ben.run("up", "bare", *bare)
        assert second.status == 0, second.err
        unclear = ben.run("node", "list")
        assert (unclear.status, "choose one of --fleet" in unclear.err) == (2, True)
        assert ben.run("node", "list", "--fleet", "own").status == 0
        wrong = ben.run("topic", "list", "--fleet", "owm")
        assert (wrong.status, "did you mean 'own'" in wrong.err) == (2, True)
        assert ben.run("down", "--fleet", "bare").status == 0
        assert [each["fleet"] for each in json.loads(ben.run("ps", "--json").out)] == ["own"]
    finally:
        for each in (anna, ben):
            each.run("down", "--all")
    assert (ben.folder / "elea/params/own.db").exists()
