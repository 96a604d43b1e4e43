"""The command line of a container: the nodes that it would run, and bad input rejected before anything starts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from services.catalog import load_component
from services.runtime.container_main import container_command, run_container_command_line
from services.runtime.errors import BadInput
from tests.harness.cases import case

OWN = """
from services.runtime import main

def run(ctx):
    pass

main(run, name="own", about="A controller.", rate=25)
"""


def _run(*arguments: str) -> object:
    return container_command(load_component).main(list(arguments), "container", standalone_mode=False)


def test_it_shows_the_nodes_that_it_would_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "nodes").write_text(
        "waypoint --namespace /tb3_0 --remap odom:=truth --fleet-param laps=3\n\nwaypoint --namespace /tb3_1\n"
    )
    file = str(tmp_path / "nodes")
    assert _run("--nodes", file, "--node", f"{tmp_path}/own.py --name mine", "--lockstep", "--print-config") is None
    shown = json.loads(capsys.readouterr().out)
    assert (shown["lockstep"], [each["service"] for each in shown["nodes"]]) == (True, ["own", "waypoint", "waypoint"])
    assert [each["identity"]["node"] for each in shown["nodes"]] == ["/mine", "/tb3_0/waypoint", "/tb3_1/waypoint"]
    assert shown["nodes"][1]["origins"] == {"laps": "fleet"}
    assert shown["nodes"][1]["lockstep"]


def test_bad_input_is_refused_with_its_place(tmp_path: Path) -> None:
    nodes = tmp_path / "nodes"
    for lines, error in {
        "": 'a container needs nodes: --node "waypoint --namespace /tb3_0", or --nodes FILE',
        "waypoint\nwaypoynt": f"{nodes}:2: unknown service 'waypoynt'; did you mean 'waypoint'?",
        "waypoint\n\nwaypoint --name waypoint": f"{nodes}:3: a node /waypoint is already declared at {nodes}:1",
        "sim": f"{nodes}:1: sim cannot share a process: the simulation never waits for it",
        "teleop": f"{nodes}:1: teleop cannot share a process: it reads the keyboard",
        "waypoint --param laps=-1": f"{nodes}:1: --param: parameter laps = -1",
        "waypoint --nam x": f"{nodes}:1: waypoint: No such option '--nam'",
        "waypoint 'open": f'{nodes}:1: "waypoint \'open" is not a service with its options: No closing quotation',
        "waypoint --print-config": f"{nodes}:1: waypoint must run: leave out the option that only describes it",
    }.items():
        nodes.write_text(lines)
        with pytest.raises(BadInput) as raised:
            _run("--nodes", str(nodes))
        assert error in str(raised.value), lines
    with pytest.raises(BadInput, match=r"--nodes: .*absent cannot be read"):
        _run("--nodes", str(tmp_path / "absent"))
    with pytest.raises(BadInput, match=r"^--node: unknown service ''"):
        _run("--node", "")


def test_errors_begin_with_the_name_of_the_process(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, name in {
        (): "container",
        ("--name", "control"): "control",
        ("--name=control",): "control",
        ("--lockstep", "--name=control"): "control",
    }.items():
        with case(arguments), pytest.raises(SystemExit) as ended:
            run_container_command_line([*arguments, "--node", "waypoynt"], load_component, "container")
        assert ended.value.code == 2
        assert capsys.readouterr().err.startswith(f"{name}: --node: unknown service 'waypoynt'"), arguments
