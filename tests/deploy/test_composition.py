"""Services of a fleet that share processes: the grouping, the processes, and errors in a fleet file."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from deploy.commands.up import override_run
from deploy.fleet_file import parse_fleet
from deploy.processes import ProcessSpec, plan_processes, write_containers
from deploy.service_parameters import RunOptions
from services.runtime.errors import BadInput

ROBOTS = "".join(
    f'[[robot]]\nname = "tb3_{n}"\nmodel = "burger"\npose = {{ x = {n}.0 }}\nservices = [{{ kind = "state" }}]\n'
    for n in range(5)
)
OWN = 'from services.runtime import main\nmain(lambda ctx: None, name="own", about="Mine.", rate=25)\n'


def _plan(text: str, folder: Path, share: int | None = None) -> dict[str, ProcessSpec]:
    fleet = parse_fleet(folder / "f.toml", f'name = "f"\n{text}')
    fleet = replace(fleet, run=replace(fleet.run, share=share))
    return {each.name: each for each in plan_processes(fleet, RunOptions(folder=folder))}


def test_a_number_groups_services_of_a_kind_evenly(tmp_path: Path) -> None:
    each = '[[every_robot]]\nkind = "waypoint"\nshare = 3\nremap = { odom = "truth" }\n'
    apart, shared = _plan(ROBOTS + each.replace("share = 3", ""), tmp_path), _plan(ROBOTS + each, tmp_path)
    assert [(name, len(each.nodes)) for name, each in shared.items() if len(each.nodes) > 1] == [
        ("waypoint-1", 2),
        ("waypoint-2", 3),
    ]
    assert shared["waypoint-1"].names == ("/tb3_0/waypoint", "/tb3_1/waypoint")
    assert shared["tb3_0/state"] == apart["tb3_0/state"]
    assert shared["waypoint-2"].policy == apart["tb3_0/waypoint"].policy
    write_containers(tuple(shared.values()), tmp_path)
    argv = shared["waypoint-2"].argv
    assert argv[3:5] == ("services", "container")
    assert {"--lockstep", "--await-params"} <= set(argv)
    lines = Path(argv[argv.index("--nodes") + 1]).read_text().splitlines()
    assert lines[0].startswith("waypoint --namespace /tb3_2 --name waypoint --remap odom:=truth")
    single = _plan(ROBOTS + each.replace("3", "1"), tmp_path)
    assert single.keys() == apart.keys()


def test_a_name_groups_different_kinds_and_files(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    two = '[[every_robot]]\nkind = "waypoint"\nshare = "control"\n[[every_robot]]\nkind = "own.py"\nshare = "control"\n'
    (spec,) = [each for each in _plan(ROBOTS + two, tmp_path).values() if len(each.nodes) > 1]
    assert (spec.name, len(spec.nodes)) == ("control", 10)
    assert spec.nodes[1].command_line == f"{tmp_path}/own.py --namespace /tb3_0 --name own"


def test_a_run_that_shares_groups_all_that_can_by_rate(tmp_path: Path) -> None:
    text = ROBOTS + '[[every_robot]]\nkind = "waypoint"\n[[service]]\nkind = "logger"\n'
    plan = _plan(text, tmp_path, share=4)
    shared = {name: len(each.nodes) for name, each in plan.items() if len(each.nodes) > 1}
    assert shared == {"shared-50hz-1": 2, "shared-50hz-2": 3, "shared-25hz-1": 2, "shared-25hz-2": 3}
    assert {"router", "params", "sim", "grader", "logger"} < plan.keys()


def test_the_command_line_goes_before_the_numbers_of_the_file(tmp_path: Path) -> None:
    text = f'name = "f"\n{ROBOTS}[[every_robot]]\nkind = "waypoint"\nshare = 25\n'
    fleet = override_run(parse_fleet(tmp_path / "f.toml", text), {"share": 2})
    plan = plan_processes(fleet, RunOptions(folder=tmp_path))
    shared = {each.name: len(each.nodes) for each in plan if each.kind == "container"}
    assert {name: count for name, count in shared.items() if "waypoint" in name} == {"waypoint-2": 2, "waypoint-3": 2}
    assert max(shared.values()) == 2


def test_what_cannot_share_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text("import rospy\nrospy.init_node('a')\n")
    for tables, error in (
        ("sim share=2", "f.toml:4: sim cannot share a process: every fleet has one"),
        ("logger share=2", "f.toml:4: logger cannot share a process: the simulation goes on"),
        ('program.py share="control"', "program.py cannot share a process: a program of ROS"),
        ('waypoint share="c" | square share="c"', 'f.toml:7: share = "c": square ticks at 50 Hz, waypoint ('),
        ('arm share="c" parameters.rate=50 | arm share="c" name="b"', "arm ticks at 100 Hz, arm ("),
        ('waypoint share="c" | waypoint share="c" name="b" restart="never"', "have different restart policies"),
        ('waypoint share="c" | waypoint name="c"', "f.toml:4: there is a node /c: give the group"),
        ("waypoint share=0", "f.toml:4: service[0].share: Expected `int` >= 1"),
        ('waypoint share="a-b"', "f.toml:4: service[0].share: Expected `str` matching"),
    ):
        services = (each.split() for each in tables.split(" | "))
        text = "".join(f'[[service]]\nkind = "{kind}"\n{chr(10).join(keys)}\n' for kind, *keys in services)
        with pytest.raises(BadInput) as raised:
            _plan(text, tmp_path)
        assert error in str(raised.value), str(raised.value)
    with pytest.raises(BadInput, match=r"f\.toml:3: run\.share: Expected `int` >= 2"):
        _plan("[run]\nshare = 1\n", tmp_path)
