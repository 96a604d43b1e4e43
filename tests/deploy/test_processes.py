"""A fleet expands into processes: their order, their arguments, and that each service accepts its own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest

from deploy.fleet import ChangeConfig, Fleet, RobotConfig, RunConfig, ServiceConfig
from deploy.fleet_file import find_fleet, fleet_names, read_fleet
from deploy.processes import MOST_DIRECT, ProcessSpec, plan_processes
from deploy.restart_policy import RestartPolicy
from deploy.service_parameters import RunOptions
from services.catalog import load_service
from services.runtime.parameters.validation import build, read_assignments
from services.runtime.transport.unix_sockets import router_endpoint

TERMS = RunOptions(folder=Path("/tmp/run"))


def expand(fleet: Fleet) -> dict[str, ProcessSpec]:
    return {each.name: each for each in plan_processes(fleet, TERMS)}


def options(process: ProcessSpec, name: str) -> list[str]:
    """Return the values of an option on a process's command line."""
    return _values(process.argv, name)


def _values(words: Sequence[str], name: str) -> list[str]:
    return [value for option, value in pairwise(words) if option == name]


@pytest.mark.parametrize("name", fleet_names())
def test_every_service_accepts_its_parameters(name: str) -> None:
    for node in (each for process in expand(read_fleet(find_fleet(name))).values() for each in process.nodes):
        build(load_service(node.kind).parameters, read_assignments(_values(node.arguments, "--fleet-param")))


def test_lab_is_the_tutorial_shifted_by_each_start() -> None:
    plan = expand(read_fleet(find_fleet("lab")))
    x, y = [5, 1, 2.5, 4, 0, 0, 5, 5, 0, 0], [0, -4, 2.5, -4, 0, 2.5, 2.5, -4, -4, 0]
    for robot in range(4):
        stated = read_assignments(options(plan[f"tb3_{robot}/waypoint"], "--fleet-param"))
        assert stated["goals"] == [[a, b + 0.5 * robot] for a, b in zip(x, y, strict=True)]
        assert stated["laps"] == 1


def test_points_from_the_start_are_put_into_the_frame_of_the_odometry(tmp_path: Path) -> None:
    """For a robot that faces west, with odometry from its start, a point one metre north of it is on the right."""
    file = tmp_path / "starts.toml"
    robots = (("a", "burger", ""), ("b", "burger", 'odometry_origin = "start"'), ("c", "p3dx", ""))
    file.write_text(
        'name = "starts"\n[[every_robot]]\nkind = "waypoint"\nfrom_start = ["goals"]\n'
        "parameters = { goals = [[0, 1]] }\n"
        + "".join(
            f'[[robot]]\nname = "{name}"\nmodel = "{model}"\nparameters = {{ {more} }}\n'
            f"pose = {{ x = {3 * number}.0, y = 2.0, yaw = 3.141592653589793 }}\n"
            for number, (name, model, more) in enumerate(robots)
        )
    )
    plan = expand(read_fleet(file))
    told = {name: read_assignments(options(plan[f"{name}/waypoint"], "--fleet-param")) for name, *_ in robots}
    assert told["a"]["goals"] == [[0, 3]]
    for name in ("b", "c"):
        assert told[name]["goals"][0] == pytest.approx([0.0, -1.0])


def test_lab_starts_in_order_and_steps_together() -> None:
    plan = expand(read_fleet(find_fleet("lab")))
    assert plan["router"].depends_on == ()
    assert plan["params"].depends_on == ("router",)
    assert plan["sim"].depends_on == ("router", "params")
    drivers = [*(f"tb3_{robot}/waypoint" for robot in range(4)), "p3dx/square", "arm/arm", "arm/reference"]
    assert all(plan[each].depends_on == ("router", "sim") for each in (*drivers, "logger", "grader"))
    members = read_assignments(options(plan["sim"], "--fleet-param"))["members"]
    assert {"/grader", "/params", *(f"/{each}" for each in drivers)} <= set(members)
    reliable = {name for each in plan.values() for name in each.names if "--lockstep" in each.argv}
    assert reliable == {*members, "/sim", "/router", "/panel"}
    assert {name for each in plan.values() for name in each.names if each.awaited} == {*members, "/sim"}


def test_losses_of_every_process_count_but_for_the_panel() -> None:
    fleet = read_fleet(find_fleet("lab"))
    recorded = msgspec.structs.replace(fleet, service=(*fleet.service, ServiceConfig(kind="recorder")))
    plan = expand(recorded)
    assert {"panel", "recorder", "logger", "tb3_0/waypoint"} <= set(plan)
    readers = read_assignments(options(plan["grader"], "--fleet-param"))["readers"]
    assert set(readers) == {name for each in plan.values() for name in each.names} - {"/panel"} | {"/supervisor"}


def test_a_script_that_steps_gets_the_seed_of_its_hashes_from_the_fleet(tmp_path: Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text("import rospy\n")
    file = tmp_path / "mine.toml"
    for mode, wanted in (("lockstep", {"COLOUR": "red", "PYTHONHASHSEED": "7"}), ("real", {"COLOUR": "red"})):
        file.write_text(
            f'name = "mine"\n[run]\nmode = "{mode}"\nseed = 7\n[[service]]\nkind = "{script}"\n'
            'environment = { COLOUR = "red" }\n'
        )
        plan = expand(read_fleet(file))
        assert plan["mine"].environment == wanted
        assert not plan["sim"].environment


def test_nobody_steps_together_on_the_wall_clock() -> None:
    fleet = read_fleet(find_fleet("lab"))
    plan = expand(msgspec.structs.replace(fleet, run=RunConfig(mode="real")))
    assert not any("--lockstep" in each.argv for each in plan.values())
    assert read_assignments(options(plan["sim"], "--fleet-param"))["members"] == []


def test_lasers_are_recorded_where_nobody_waits_for_the_simulation() -> None:
    fleet = read_fleet(find_fleet("lab"))
    for mode, recorded in (("lockstep", False), ("real", True)):
        plan = expand(msgspec.structs.replace(fleet, run=RunConfig(mode=mode)))
        assert read_assignments(options(plan["logger"], "--fleet-param"))["scans"] is recorded
    asked = ServiceConfig(kind="logger", parameters={"scans": True})
    plan = expand(msgspec.structs.replace(fleet, service=(asked,)))
    assert read_assignments(options(plan["logger"], "--fleet-param"))["scans"] is True


def test_in_every_mode_time_begins_with_all_but_onlookers() -> None:
    fleet = read_fleet(find_fleet("lab"))
    needed = ServiceConfig(kind="logger", name="needed", required=True)
    service = (*fleet.service, ServiceConfig(kind="recorder"), needed)
    for mode in ("real", "lockstep"):
        plan = expand(msgspec.structs.replace(fleet, service=service, run=RunConfig(mode=mode)))
        told = read_assignments(options(plan["sim"], "--fleet-param"))
        everybody = {name for each in plan.values() for name in each.names} - {"/router", "/sim", "/panel"}
        assert {*told["members"], *told["awaits"]} == everybody
        assert set(told["requires"]) == {"/params", "/grader", "/needed"}
        assert {name for each in plan.values() for name in each.names if each.awaited} == {*everybody, "/sim"}


def test_what_the_end_of_each_means() -> None:
    plan = expand(read_fleet(find_fleet("lab")))
    assert {each.name for each in plan.values() if each.required} == {"router", "params", "sim", "grader"}
    assert {each.name: each.policy.when for each in plan.values()} == {
        "router": "always",
        "params": "on-failure",
        "sim": "on-failure",
        "grader": "never",
        "logger": "on-failure",
        "panel": "on-failure",
        "p3dx/square": "on-failure",
        "arm/arm": "on-failure",
        "arm/reference": "on-failure",
        **{f"tb3_{robot}/waypoint": "on-failure" for robot in range(4)},
    }


def test_the_services_of_every_robot_may_be_for_some_models_alone() -> None:
    shared = ServiceConfig(kind="waypoint", models=("burger",))
    robots = (RobotConfig(name="a", model="burger"), RobotConfig(name="b", model="p3dx"))
    plan = expand(Fleet(name="own", robot=robots, every_robot=(shared,)))
    assert "a/waypoint" in plan
    assert "b/waypoint" not in plan


def test_the_grader_knows_how_each_base_stops() -> None:
    own = {"cmd_vel_timeout": 0.5, "brake": 0.3}
    robots = (RobotConfig(name="a", model="p3dx", parameters=own), RobotConfig(name="b", model="p3dx"))
    told = read_assignments(options(expand(Fleet(name="own", robot=robots))["grader"], "--fleet-param"))["halting"]
    assert told == [{"name": "a", "timeout": 0.5, "brake": 0.3}, {"name": "b", "timeout": 0.25, "brake": 1.5}]


def test_an_arm_its_reference_and_the_grader_are_told_of_its_joint() -> None:
    own = (ServiceConfig(kind="arm", parameters={"saturation": 150.0}), ServiceConfig(kind="reference"))
    changes = (ChangeConfig(at=3.0, set="/robot_control", values={"ref_angle": 30.0}),)
    robots = (RobotConfig(name="a", model="arm", services=own), RobotConfig(name="b", model="burger"))
    plan = expand(Fleet(name="own", robot=robots, change=changes))
    told = {name: read_assignments(options(plan[name], "--fleet-param")) for name in ("a/arm", "a/reference", "grader")}
    assert told["a/arm"]["joint"] == "bear_link"
    assert told["a/arm"]["gravity_torque"] == pytest.approx(27.15, abs=0.01)
    assert told["a/arm"]["gravity_rest"] == pytest.approx(-1.4635, abs=0.001)
    assert told["a/arm"]["inertia"] == pytest.approx(3.8655, abs=0.0001)
    assert told["a/arm"]["saturation"] == 150.0
    for name in ("a/arm", "a/reference"):
        assert (told[name]["lower"], told[name]["upper"]) == pytest.approx((-90.0, 90.0), abs=0.001)
    state = {"name": "a", "joint": "bear_link", "saturation": 150.0, "state": "/robot_control/state"}
    assert told["grader"]["arms"] == [state]
    assert [each["name"] for each in told["grader"]["halting"]] == ["b"]
    assert told["grader"]["not_before"] > 3.0


def test_who_starts_after_the_parameters_waits_for_them_and_they_are_kept_in_the_file_of_the_terms() -> None:
    plan = expand(read_fleet(find_fleet("lab")))
    assert {name for name, each in plan.items() if "--await-params" not in each.argv} == {"router", "params"}
    told = read_assignments(options(plan["params"], "--fleet-param"))
    assert told["file"] == ""
    assert [(each["at"], each["set"]) for each in told["schedule"]] == [(at, "/robot_control") for at in (1, 4, 20.2)]
    terms = RunOptions(folder=Path("/tmp/run"), saved=Path("/tmp/params/lab.db"))
    (params,) = (each for each in plan_processes(read_fleet(find_fleet("lab")), terms) if each.kind == "params")
    assert read_assignments(options(params, "--fleet-param"))["file"] == "/tmp/params/lab.db"


def test_stated_beats_implied() -> None:
    fleet = Fleet(
        name="own",
        run=RunConfig(mode="real", port=9000, topology="star"),
        service=(
            ServiceConfig(kind="sim", parameters={"world": "arena"}, required=False, restart="never"),
            ServiceConfig(
                kind="logger", name="log", namespace="/tools", remap={"odom": "/x/odom"}, restart=RestartPolicy(limit=1)
            ),
        ),
    )
    plan = expand(fleet)
    assert list(plan) == ["router", "params", "sim", "grader", "tools/log"]
    assert read_assignments(options(plan["sim"], "--fleet-param"))["world"] == "arena"
    assert (plan["sim"].required, plan["sim"].policy) == (False, RestartPolicy(when="never"))
    assert plan["tools/log"].policy == RestartPolicy(limit=1)
    assert options(plan["tools/log"], "--namespace") == ["/tools"]
    assert options(plan["tools/log"], "--remap") == ["odom:=/x/odom"]
    assert options(plan["tools/log"], "--connect") == [router_endpoint(9000)]
    assert options(plan["sim"], "--topology") == ["star"]
    told = read_assignments(options(plan["router"], "--fleet-param"))
    assert (told["listen"], told["also"], told["insecure"]) == (router_endpoint(9000), [], False)


def test_tcp_comes_where_the_fleet_or_the_command_line_asks_for_it() -> None:
    there = "tcp/127.0.0.1:9100"
    for tcp, listen, also in (
        (False, (), []),
        (True, (), ["tcp/127.0.0.1:9000"]),
        (False, (there,), [there]),
        (True, ("tcp/127.0.0.1:9000", there), ["tcp/127.0.0.1:9000", there]),
    ):
        fleet = Fleet(name="own", run=RunConfig(port=9000, tcp=tcp))
        [router] = [
            each
            for each in plan_processes(fleet, RunOptions(folder=Path("/r"), listen=listen))
            if each.kind == "router"
        ]
        assert read_assignments(options(router, "--fleet-param"))["also"] == also
    shipped = {name for name in fleet_names() if read_fleet(find_fleet(name)).run.tcp}
    assert shipped == {"bare"}


@pytest.mark.parametrize(("router", "view"), [(7447, None), (7448, 9877), (1024, 3453), (65535, None)])
def test_two_fleets_have_two_live_views(router: int, view: int | None) -> None:
    fleet = Fleet(name="own", run=RunConfig(port=router), service=(ServiceConfig(kind="logger"),))
    assert read_assignments(options(expand(fleet)["logger"], "--fleet-param")).get("port") == view


def test_a_robot_in_the_root_namespace_has_its_services_there(tmp_path: Path) -> None:
    file = tmp_path / "root.toml"
    file.write_text(
        'name = "root"\n[[robot]]\nname = "tb3"\nmodel = "burger"\nnamespace = "/"\nframe_prefix = ""\n'
        'services = [{ kind = "state" }]\n[[robot]]\nname = "b"\nmodel = "burger"\nnamespace = "left/b"\n'
        'pose = { x = 3.0 }\n[[every_robot]]\nkind = "waypoint"\n[[service]]\nkind = "logger"\n'
        '[[change]]\nat = 1.0\nset = "/base"\nvalues = { cmd_vel_timeout = 0.5 }\n'
    )
    plan = expand(read_fleet(file))
    assert {"waypoint", "left/b/waypoint", "state"} <= plan.keys()
    assert plan["waypoint"].names == ("/waypoint",)
    told = read_assignments(options(plan["sim"], "--fleet-param"))["robots"]
    assert (told[0]["namespace"], told[0]["frame_prefix"], told[1]["namespace"]) == ("/", "", "left/b")
    assert "frame_prefix" not in told[1]
    for kind in ("grader", "logger"):
        told = read_assignments(options(plan[kind], "--fleet-param"))
        assert (told["robots"], told["namespaces"]) == (["tb3", "b"], ["/", "/left/b"])
    assert told["frame_prefixes"] == ["", "b/"]
    assert read_assignments(options(plan["state"], "--fleet-param"))["frame_prefix"] == ""


def test_a_fleet_of_many_nodes_joins_the_router_alone_unless_it_states_a_topology() -> None:
    def topology(robots: int, share: int | None = None, **stated: Any) -> set[str]:
        fleet = Fleet(
            name="many",
            run=RunConfig(**stated),
            robot=tuple(RobotConfig(name=f"r{number}", model="burger") for number in range(robots)),
            every_robot=(ServiceConfig(kind="waypoint", share=share),),
        )
        return {each for spec in expand(fleet).values() for each in options(spec, "--topology")}

    few = MOST_DIRECT - 4  # plus router, parameters, simulation and grader
    assert topology(few) == {"direct"}
    assert topology(few + 1) == {"star"}
    assert topology(few + 1, topology="direct") == {"direct"}
    assert topology(1, topology="star") == {"star"}
    assert topology(few, share=4) == {"direct"}
    assert topology(few + 1, share=4) == {"star"}, "nodes count, whether or not they share a process"
