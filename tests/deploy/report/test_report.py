"""The report: its schema, its bounds, its table and its picture, made from a simulated run."""

from __future__ import annotations

import io
import json
import os
import re
from pathlib import Path

import jsonschema
import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from deploy.commands.report import command
from deploy.fleet import ChangeConfig
from deploy.report.axes import shorten_name
from deploy.report.checks import Bound, Bounds, check_bounds, service_checks
from deploy.report.picture import draw_figure
from deploy.report.picture_many import LINES, sample_trail
from deploy.report.ranking import robot_of_check, worst_first
from deploy.report.record import PICTURE_FILE, REPORT_FILE, SCHEMA_FILE, Report, RunFacts, report_schema, schema_text
from deploy.report.table import SHOWN, format_fixed, format_number, print_report
from deploy.report.write import build_report, read_measurements, to_json, write_report
from deploy.supervisor.node import RunMonitor
from messages.elea import Check as Stated
from messages.elea import LockstepState
from messages.geometry import Pose, Vector3
from messages.parameters import ScheduledChange, ScheduledChanges
from messages.simulation import SimStatus
from messages.std import ColorRGBA, Time
from messages.visualization import Marker, MarkerArray
from models.palette import colour, hexadecimal
from services.grader.records import TRAJECTORIES_FILE, EndReason, Measurements
from services.grader.results import prepare_folder, world_arrays, write_atomic, write_results
from services.markers.world_bodies import world_bodies
from services.runtime.errors import BadInput
from tests.services.grader.simulated_run import measure_all, robot_messages

NAMES = ("tb3_0", "tb3_1")
FACTS = RunFacts(fleet="lab", mode="lockstep", seed=1, version="0.1.0", wall_seconds=50.0, restarts=0, topology="star")
ISSUED_RUN = "fleet mode sim_seconds wall_seconds real_time_factor seed version trajectory_hash messages_lost restarts"
ISSUED_ROBOT = (
    "points points_reached cross_track_rms_m cross_track_max_m odometry_error_max_m path_length_m min_distance_m "
    "collisions commands_timed_out"
)


def put_run(folder: Path, end: float = 400.0, ended: EndReason = "goals") -> Path:
    run = measure_all(
        [post for shift, name in enumerate(NAMES) for post in robot_messages(name, 0.5 * shift)], NAMES, end
    )
    write_results(
        prepare_folder(folder), run.measurements(ended, LockstepState(members=("/tb3_0/waypoint",))), run.robots
    )
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return put_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def measured(folder: Path) -> Measurements:
    return read_measurements(folder)


@pytest.mark.slow
def test_the_report_of_a_run_fits_its_schema_and_holds_the_promised_keys(folder: Path) -> None:
    report = write_report(folder, FACTS, {})
    tree = json.loads((folder / REPORT_FILE).read_text())
    jsonschema.Draft202012Validator(report_schema()).validate(tree)
    assert tree["schema"] == 1
    assert tree["ok"] is report.ok is True
    assert set(ISSUED_RUN.split()) <= set(tree["run"])
    assert set(tree["robots"]) == set(NAMES)
    for figures in tree["robots"].values():
        assert set(ISSUED_ROBOT.split()) <= set(figures)
    assert all({"name", "value", "bound", "ok"} <= set(each) for each in tree["checks"])
    assert tree["run"]["real_time_factor"] == pytest.approx(8.0)


def test_the_schema_refuses_a_report_without_a_key(folder: Path, measured: Measurements) -> None:
    tree = json.loads(to_json(build_report(measured, FACTS, {})))
    del tree["robots"]["tb3_0"]["collisions"]
    with pytest.raises(jsonschema.ValidationError) as refused:
        jsonschema.Draft202012Validator(report_schema()).validate(tree)
    assert any("collisions" in each.message for each in refused.value.context or ())


def test_the_schema_file_is_that_of_the_records_and_every_key_is_documented() -> None:
    assert SCHEMA_FILE.read_text() == schema_text()
    text = SCHEMA_FILE.with_name("README.md").read_text()
    definitions = report_schema()["$defs"]
    records = {"RunFigures": "run.", "RobotFigures": "robots.*.", "CornerFigures": "robots.*.corners.*."}
    records |= {"ArmFigures": "robots.*.", "StepFigures": "robots.*.steps.*."}
    for record, prefix in {
        **records,
        "Check": "checks.*.",
        "EffectiveParameter": "parameters.*.*.",
        "Report": "",
    }.items():
        for key in definitions[record]["properties"]:
            assert re.search(rf"`{re.escape(prefix + key)}[`.]", text), prefix + key


@pytest.mark.slow
def test_the_picture_is_a_png_of_a_readable_size(folder: Path) -> None:
    write_report(folder, FACTS, {})
    head = (folder / PICTURE_FILE).read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    assert int.from_bytes(head[16:20]) >= 1200


def test_everything_drawn_has_data_units_and_a_look_of_its_own(folder: Path, measured: Measurements) -> None:
    """Two robots with the same motion, one with a long name, can both be seen and told apart without colours."""
    figure = draw_figure(build_report(measured, FACTS, {}), folder / "trajectories.npz")
    assert [each.get_title(loc="left") for each in figure.axes] == [
        "Paths seen from above",
        "True speed",
        "Distance of the true position from the reference path",
    ]
    for axes in figure.axes:
        assert axes.lines, axes.get_title(loc="left")
        assert all(re.search(r"\[.+\]$", label) for label in (axes.get_xlabel(), axes.get_ylabel()))
    for axes in figure.axes[1:]:
        looks = {(line.get_linewidth(), str(line.get_linestyle())) for line in axes.lines}
        assert len(looks) == len(axes.lines) == 2
        assert [line.get_color() for line in axes.lines] == [hexadecimal(colour(0)), hexadecimal(colour(1))]
    assert shorten_name("/robot_control/tracking_controller/error", 20) == "\N{HORIZONTAL ELLIPSIS}ng_controller/error"
    assert shorten_name("tb3_0", 20) == "tb3_0"


@pytest.mark.slow
def test_the_picture_has_the_world_around_what_was_driven(tmp_path: Path) -> None:
    """The robots drive within 1 m; one box stands beside them, one moves, a third is far off, and a wall is long."""
    run = measure_all(list(robot_messages("tb3_0", 0.0)), ("tb3_0",))
    size = Vector3(x=0.4, y=0.4, z=0.4)
    long, red = Vector3(x=200.0, y=0.1, z=0.4), ColorRGBA(r=1.0, a=1.0)
    array = MarkerArray(
        markers=tuple(
            Marker(ns=kind, text=name, type=Marker.CUBE, pose=Pose.planar(x, y), scale=scale, color=red)
            for name, kind, x, y, scale in (
                ("beside", "fixed", 1.0, 0.2, size),
                ("cart", "moving", 0.0, 0.9, size),
                ("far", "fixed", 50.0, 0.0, size),
                ("wall", "fixed", 0.0, -0.5, long),
            )
        )
    )
    world = [(body, body.footprints()) for body in world_bodies(array)]
    arrays = world_arrays(world, {"cart": [(0.0, 0.9), (0.5, 0.9)]})
    write_results(tmp_path, run.measurements("goals"), run.robots, arrays)
    figure = draw_figure(write_report(tmp_path, FACTS, {}), tmp_path / "trajectories.npz")
    above = figure.axes[0]
    (bodies,) = above.collections
    assert len(bodies.get_paths()) == 4
    assert bodies.get_facecolors()[0][:3].tolist() == [1.0, 0.0, 0.0]
    assert any(line.get_xdata().tolist() == [0.0, 0.5] for line in above.lines), "the way of the cart"
    figure.canvas.draw()
    (left, right), (bottom, top) = above.get_xlim(), above.get_ylim()
    assert right > 1.2
    assert bottom < -0.55
    assert right - left < 6, "neither the far box nor the end of the wall is shown"
    assert top > 1.1


def test_numbers_have_no_rests_of_calculations() -> None:
    assert [format_number(value, 30.0) for value in (-9.52e-10, 0.0, 1e-4, -12.5)] == ["0", "0", "0.0001", "-12.5"]
    assert [format_fixed(value, 2) for value in (-0.001, 0.004, -0.2)] == ["0.00", "0.00", "-0.20"]
    assert [format_fixed(value, 1, sign=True) for value in (-0.01, 0.2, -0.2)] == ["0.0", "+0.2", "-0.2"]


def test_a_change_that_was_not_made_and_a_node_that_was_missing_are_named(measured: Measurements) -> None:
    made, refused, late = (
        ChangeConfig(at=at, set="/arm/joints", values={"damping": at}) for at in (1.0, 2.0, measured.sim_seconds + 1)
    )
    conduct = RunMonitor()
    told = ScheduledChange(number=1, made=False, time=Time(sec=2), reason="damping is out of bounds")
    conduct.on_scheduled_changes(
        ScheduledChanges(changes=(ScheduledChange(number=0, made=True, time=Time(sec=1)), told))
    )
    # The parameter service was restarted and reports only its own lifetime.
    conduct.on_scheduled_changes(ScheduledChanges(changes=(ScheduledChange(number=1, made=True, time=Time(sec=3)),)))
    conduct.on_sim_status(b"first", SimStatus(begun=True, absent=("/logger",), lags=2, lag=0.5))
    conduct.on_sim_status(b"second", SimStatus(begun=True, lags=1, lag=0.25))
    # The fleet file has them in any order.
    changes = conduct.change_figures((late, refused, made), measured.sim_seconds)
    assert [(each.at_s, each.made, each.made_at_s) for each in changes[:2]] == [(1.0, True, 1.0), (2.0, False, None)]
    assert changes[2].made is None
    facts = msgspec.structs.replace(FACTS, changes=changes, absent=conduct.absent_nodes, lag_s=conduct.lag_s)
    report = build_report(measured, facts, {})
    assert (report.ok, report.run.changes_missed, report.run.absent, report.run.lag_s) == (False, 1, ("/logger",), 0.75)
    assert [each.name for each in report.checks if not each.ok] == ["changes_missed", "nodes_absent"]
    out = io.StringIO()
    print_report(report, out)
    assert (
        "\n  the change of /arm/joints at 2 s was not made (damping = 2.0): damping is out of bounds\n"
        in out.getvalue()
    )
    assert "\n  time began without /logger\n" in out.getvalue()
    assert "not reached before the end: the scheduled changes of /arm/joints at 401 s\n" in out.getvalue()
    assert list(conduct.new_problems((late, refused, made))) == [
        "time began without /logger: see ./elea logs",
        "the change of /arm/joints scheduled at 2 s was not made: damping is out of bounds",
    ]
    assert list(conduct.new_problems((late, refused, made))) == [], "each is said once"
    silent = RunMonitor().change_figures((made,), measured.sim_seconds)
    assert silent[0].made is False, "nobody tells of it"


def test_a_late_machine_is_named_where_it_may_be_to_blame(measured: Measurements) -> None:
    late = msgspec.structs.replace(measured, ticks_missed={"/tb3_0/waypoint": 7})
    real = msgspec.structs.replace(FACTS, mode="real", factor=2.0)
    assert build_report(late, real, {}).notes == (), "a tick now and then, and all checks hold"
    (note,) = build_report(late, real, {"collisions": -1}).notes
    assert "did not keep up with real time at factor 2: ticks were missed by /tb3_0/waypoint 7" in note
    (note,) = build_report(measured, msgspec.structs.replace(real, lag_s=1.5), {}).notes
    assert "the simulation fell behind by 1.5 s in all" in note
    assert build_report(late, FACTS, {"collisions": -1}).notes == (), "lockstep waits"


def test_reports_and_measurements_of_earlier_versions_are_read(measured: Measurements) -> None:
    tree = json.loads(to_json(build_report(measured, FACTS, {})))
    tree["run"]["mode"] = "free"
    del tree["changes"]
    for name in ("changes_missed", "nodes_absent", "absent", "factor", "lag_s", "ticks_missed"):
        del tree["run"][name]
    jsonschema.Draft202012Validator(report_schema()).validate(tree)
    assert msgspec.convert(tree, Report).run.mode == "free"
    del tree["robots"]["tb3_0"]["min_clearance_m"]
    assert msgspec.convert(tree, Report).robots["tb3_0"].min_clearance_m is None
    old = msgspec.to_builtins(measured)
    del old["ticks_missed"]
    assert msgspec.convert(old, Measurements).ticks_missed == {}


@pytest.mark.parametrize(
    ("bounds", "missed"),
    [
        ({}, []),
        ({"cross_track_rms_m": 1e-9}, ["tb3_0.cross_track_rms_m", "tb3_1.cross_track_rms_m"]),
        ({"min_distance_m": Bound(min=0.6)}, ["tb3_0.min_distance_m", "tb3_1.min_distance_m"]),
        ({"real_time_factor": Bound(min=9, max=20)}, ["real_time_factor"]),
        ({"messages_lost": -1}, ["messages_lost"]),
        ({"points_reached": Bound(min=4)}, ["tb3_0.points_reached", "tb3_1.points_reached"]),
    ],
)
def test_a_missed_bound_makes_the_report_not_ok(measured: Measurements, bounds: Bounds, missed: list[str]) -> None:
    report = build_report(measured, FACTS, bounds)
    assert [each.name for each in report.checks if not each.ok] == missed
    assert report.ok == (not missed)


def test_without_bounds_points_collisions_and_losses_are_checked(measured: Measurements) -> None:
    first = msgspec.structs.replace(measured.robots["tb3_0"], collisions=1, points_reached=2)
    spoiled = msgspec.structs.replace(measured, messages_lost=3, robots={**measured.robots, "tb3_0": first})
    report = build_report(spoiled, FACTS, {})
    assert not report.ok
    assert {each.name: each.value for each in report.checks if not each.ok} == {
        "tb3_0.points_reached": 2,
        "tb3_0.collisions": 1,
        "messages_lost": 3,
    }


def test_what_was_not_measured_misses_its_bound(measured: Measurements) -> None:
    """Whether one robot or the whole run lacks it; JSON, table, verdict and ``ok`` agree."""
    unseen = msgspec.structs.replace(
        measured.robots["tb3_0"], min_distance_m=None, cross_track_rms_m=None, collisions=None
    )
    for robots, bounds, missed in (
        ({"tb3_0": unseen}, {"cross_track_rms_m": 0.01}, ["tb3_0.cross_track_rms_m"]),
        ({"tb3_0": unseen}, {"min_distance_m": Bound(min=0.3)}, ["tb3_0.min_distance_m"]),
        ({**measured.robots, "tb3_0": unseen}, {"min_distance_m": Bound(min=0.3)}, ["tb3_0.min_distance_m"]),
        ({"tb3_0": unseen}, {"collisions": 0}, ["tb3_0.collisions"]),
        (measured.robots, {"step_rise_s": Bound(min=0.1, max=0.2)}, ["step_rise_s", "step_rise_s"]),
        ({}, {"path_length_m": 9}, ["path_length_m"]),
        (measured.robots, {"min_distance_m": Bound(min=0.3)}, []),
    ):
        report = build_report(msgspec.structs.replace(measured, robots=robots), FACTS, bounds)
        assert [each.name for each in report.checks if not each.ok] == missed
        assert report.ok == (not missed)
        assert all((each.value is None) != each.ok for each in report.checks)
        out = io.StringIO()
        print_report(report, out)
        text = out.getvalue()
        assert all(f"missed: {name} is not measured, should be at" in text for name in missed)
        held = f"{len(report.checks) - len(missed)} of {len(report.checks)} checks hold"
        assert text.endswith(f"FAILED: {held}, {len(missed)} not measured\n" if missed else f"passed: {held}\n")


def test_a_clearance_below_its_bound_is_told_with_the_body_and_the_time(measured: Measurements) -> None:
    near = msgspec.structs.replace(
        measured.robots["tb3_0"], min_clearance_m=0.05, min_clearance_at_s=12.3, min_clearance_to="red_box"
    )
    run = msgspec.structs.replace(measured, robots={"tb3_0": near})
    report = build_report(run, FACTS, {"min_clearance_m": Bound(min=0.1)})
    out = io.StringIO()
    print_report(report, out)
    assert (
        "missed: tb3_0.min_clearance_m is 0.05, should be at least 0.1\n  nearest to red_box at 12.30 s\n"
        in out.getvalue()
    )
    assert build_report(run, FACTS, {"min_clearance_m": Bound(min=0.01)}).ok
    nowhere = build_report(measured, FACTS, {"min_clearance_m": Bound(min=0.01)})
    assert [(each.name, each.value) for each in nowhere.checks if not each.ok] == [
        ("tb3_0.min_clearance_m", None),
        ("tb3_1.min_clearance_m", None),
    ]


def test_a_robot_without_a_plan_or_a_base_has_no_checks_of_them(measured: Measurements) -> None:
    still = msgspec.structs.replace(
        measured.robots["tb3_0"], points=0, points_reached=0, collisions=None, commands_timed_out=None
    )
    alone = msgspec.structs.replace(measured, robots={"pole": still})
    assert [each.name for each in build_report(alone, FACTS, {}).checks] == [
        "pole.samples",
        "messages_lost",
        "members_lost",
    ]
    bounded = build_report(alone, FACTS, {"points_reached": Bound(min=1)})
    assert not bounded.ok


def test_a_run_that_lockstep_lost_a_member_of_does_not_pass(measured: Measurements) -> None:
    """A member that left in order is only noted, but counts as lost if its process failed.

    Without lockstep neither is checked; in lockstep the lost members must be known.
    """
    lost = msgspec.structs.replace(measured, members_lost=("/tb3_0/waypoint",))
    report = build_report(lost, FACTS, {})
    assert [(each.name, each.value) for each in report.checks if not each.ok] == [("members_lost", 1)]
    assert not report.ok
    assert report.notes == ("lockstep went on without /tb3_0/waypoint: the run does not repeat",)
    left = build_report(msgspec.structs.replace(measured, members_left=("/teleop",)), FACTS, {})
    assert (left.ok, left.run.members_left) == (True, 1)
    assert left.notes == ("/teleop left lockstep before the end",)
    failed = build_report(
        msgspec.structs.replace(measured, members_left=("/teleop", "/own")),
        msgspec.structs.replace(FACTS, failed=("/own", "/panel")),
        {},
    )
    assert [(each.name, each.value) for each in failed.checks if not each.ok] == [("members_lost", 1)]
    assert failed.run.members_left == 1
    assert failed.notes == (
        "lockstep went on without /own: the run does not repeat",
        "/teleop left lockstep before the end",
    )
    unknown = msgspec.structs.replace(measured, members_lost=None)
    assert [each.name for each in build_report(unknown, FACTS, {}).checks if not each.ok] == ["members_lost"]
    assert build_report(unknown, msgspec.structs.replace(FACTS, mode="real"), {}).ok


def test_lost_messages_are_named_with_who_lost_them_most_first(measured: Measurements) -> None:
    losses = {"/grader": {"/clock": 3}, "/tb3_0/waypoint": {"/clock": 1, "/tb3_0/odom": 5}}
    lost = build_report(msgspec.structs.replace(measured, messages_lost=9, losses=losses), FACTS, {})
    assert [each.name for each in lost.checks if not each.ok] == ["messages_lost"]
    assert lost.notes == (
        "messages lost: /tb3_0/waypoint lost 5 of /tb3_0/odom, /grader lost 3 of /clock, /tb3_0/waypoint lost 1 of "
        "/clock",
    )


def test_a_bound_on_nothing_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(BadInput, match=r"fleet\.toml.*did you mean 'cross_track_rms_m'"):
        check_bounds({"cross_track_rsm_m": 0.1}, "fleet.toml")
    with pytest.raises(BadInput, match="min, max or both"):
        check_bounds({"collisions": Bound()}, "fleet.toml")
    check_bounds({"collisions": 0, "real_time_factor": Bound(min=1)}, "fleet.toml")


@pytest.mark.slow
def test_a_run_stopped_half_way_gives_a_partial_report(tmp_path: Path) -> None:
    report = write_report(put_run(tmp_path, end=5.0, ended="stopped"), FACTS, {})
    assert report.run.ended == "stopped"
    assert report.run.sim_seconds == 5
    assert not report.ok
    assert report.robots["tb3_0"].points_reached < report.robots["tb3_0"].points
    assert report.robots["tb3_0"].time_s is None


def test_a_run_of_which_nothing_was_seen_is_drawn_but_does_not_pass(tmp_path: Path) -> None:
    run = measure_all([], NAMES)
    write_results(tmp_path, run.measurements("stopped", LockstepState()), run.robots)
    report = write_report(tmp_path, FACTS, {})
    assert [each.name for each in report.checks if not each.ok] == ["tb3_0.samples", "tb3_1.samples"]
    figure = draw_figure(report, tmp_path / "trajectories.npz")
    assert figure.axes == [], "a plot without data is none"
    assert "Nothing was measured" in " ".join(text.get_text() for text in figure.texts)
    assert (tmp_path / PICTURE_FILE).exists()


def test_a_piped_table_is_plain_and_tells_every_robot_and_miss(measured: Measurements) -> None:
    out = io.StringIO()
    print_report(build_report(measured, FACTS, {"collisions": -1}), out)
    text = out.getvalue()
    assert "\x1b" not in text
    assert text.isascii()
    assert "tb3_0     3/3" in text
    assert "missed: tb3_1.collisions is 0, should be at most -1" in text
    assert "FAILED: 6 of 8 checks hold" in text


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_of_80_columns_the_table_is_complete_too(
    measured: Measurements, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    out = Terminal()
    print_report(build_report(measured, FACTS, {"cross_track_max_m": 1e-9}), out)
    assert "…" not in out.getvalue()
    for text in ("tb3_0", "3/3", "missed: tb3_1.cross_track_max_m", "FAILED"):
        assert text in out.getvalue()


def test_no_measurements_is_said_plainly(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="the grader ended before the run"):
        write_report(tmp_path, FACTS, {})
    (tmp_path / "measurements.json").write_text('{"ended": "goals"}')
    with pytest.raises(BadInput, match="sim_seconds"):
        read_measurements(tmp_path)
    (tmp_path / "measurements.json").write_bytes(b'{"ended": "go\xe5ls"}')
    with pytest.raises(BadInput, match="cannot be read"):
        read_measurements(tmp_path)


def test_a_folder_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("")
    with pytest.raises(BadInput, match="cannot be written"):
        prepare_folder(occupied / "run")
    with pytest.raises(BadInput, match="cannot be written"):
        write_atomic(tmp_path / "missing" / "report.json", b"{}")
    assert os.listdir(tmp_path) == ["file"]


def test_the_report_can_be_read_back(measured: Measurements) -> None:
    report = build_report(measured, FACTS, {})
    assert msgspec.json.decode(to_json(report), type=Report) == report


MANY = 100
STUCK, LATE = "tb3_17", "tb3_88"


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory, folder: Path, measured: Measurements) -> tuple[Path, Report]:
    """A run of a hundred robots: one collided and missed its goals, one strayed far from its path."""
    made = tmp_path_factory.mktemp("many")
    with np.load(folder / TRAJECTORIES_FILE) as stored:
        arrays = dict(stored)
    trail, path = arrays.pop("tb3_0.trail"), arrays.pop("tb3_0.path")
    arrays = {name: each for name, each in arrays.items() if name.startswith("world.")}
    robots = {}
    for number in range(MANY):
        shift, name = np.array([number % 10, number // 10]), f"tb3_{number}"
        moved = trail.copy()
        moved[:, 1:3] += shift
        arrays[f"{name}.trail"], arrays[f"{name}.path"] = moved, path + shift
        robots[name] = msgspec.structs.replace(measured.robots["tb3_0"], cross_track_max_m=0.001 + 1e-5 * number)
    robots[STUCK] = msgspec.structs.replace(robots[STUCK], points_reached=1, collisions=1)
    robots[LATE] = msgspec.structs.replace(robots[LATE], cross_track_max_m=0.5)
    np.savez(made / TRAJECTORIES_FILE, allow_pickle=False, **arrays)
    run = msgspec.structs.replace(measured, robots=robots)
    return made, build_report(run, FACTS, {"cross_track_max_m": 0.1, "path_length_m": 0.0})


def test_the_table_of_a_hundred_robots_is_a_screenful_with_the_worst_first(many: tuple[Path, Report]) -> None:
    _, report = many
    out = Terminal()
    print_report(report, out)
    lines = re.sub(r"\x1b\[[\d;]*m", "", out.getvalue()).splitlines()
    assert len(lines) <= 30
    rows = [line.split()[0] for line in lines if re.match(r"tb3_\d+ +\d+/\d+ ", line)]
    assert rows[:3] == [STUCK, LATE, "tb3_99"], "by checks missed, then by the figures"
    assert len(rows) == SHOWN
    assert "all 100  298/300 " in "\n".join(lines), lines
    assert any("90 more miss checks: ./elea report --all shows each" in line for line in lines)
    text = " ".join(lines)
    assert "missed by 100 of 100 robots: path_length_m, should be at most 0: tb3_0 " in text
    assert "and 97 more" in text
    assert f"missed: {STUCK}.collisions is 1, should be at most 0" in text, "what few miss is told of each"
    every = io.StringIO()
    print_report(report, every, every=True)
    assert len(re.findall(r"^tb3_\d+ ", every.getvalue(), re.MULTILINE)) == MANY
    assert len(re.findall(r"^missed: ", every.getvalue(), re.MULTILINE)) == MANY + 3


def test_checks_of_services_belong_to_their_robots_and_are_told_together(many: tuple[Path, Report]) -> None:
    _, report = many
    stated = {
        f"/tb3_{number}/judge": [Stated(name="farthest_m", value=float(number), max=98.5)] for number in range(MANY)
    }
    checks = service_checks(stated)
    told = msgspec.structs.replace(report, checks=checks, ok=False)
    assert [robot_of_check(each.name, told) for each in checks] == [each.split("/")[1] for each in sorted(stated)]
    assert worst_first(told)[0] == "tb3_99"
    out = io.StringIO()
    print_report(told, out)
    held = "holds for 99 of 100 robots: judge.farthest_m, should be at most 98.5: tb3_98 98, tb3_97 97, tb3_96 96 and"
    assert held in out.getvalue()
    assert "missed: /tb3_99/judge.farthest_m is 99, should be at most 98.5\n" in out.getvalue()


def test_the_picture_of_a_hundred_robots_has_percentiles_and_names_the_worst(many: tuple[Path, Report]) -> None:
    folder, report = many
    figure = draw_figure(report, folder / TRAJECTORIES_FILE)
    above, along, across, *small = figure.axes
    assert len(above.collections[0].get_paths()) == MANY
    assert [each.get_text() for each in above.texts][:2] == [STUCK, LATE]
    for axes in (along, across):
        labels = [each.get_text() for each in axes.get_legend().get_texts()]
        assert labels[:4] == ["5 to 95 %", "25 to 75 %", "median", "largest"]
        assert labels[4:6] == [STUCK, LATE]
        assert len(axes.lines) == 2 + LINES, "no line for each of the others"
    assert len(small) == 4
    assert all(len(np.concatenate([each.get_offsets() for each in axes.collections])) == MANY for axes in small)
    half = np.array([[0.0, 0, 0, 0, 0, 0, 0, 1.0], [1.0, 0, 0, 0, 0, 0, 0, 2.0]])
    assert np.array_equal(
        sample_trail(half, "speed", np.array([-1.0, 0.5, 2.0])), [np.nan, 1.5, np.nan], equal_nan=True
    )
    figure.canvas.draw()


def test_the_report_of_a_run_is_shown_again(tmp_path: Path, many: tuple[Path, Report]) -> None:
    (tmp_path / REPORT_FILE).write_bytes(to_json(many[1]))
    shown = CliRunner().invoke(command, [str(tmp_path), "--all"])
    assert shown.exit_code == 1
    assert shown.output.count("tb3_99 ") >= 1
    with pytest.raises(BadInput, match="has ended"):
        CliRunner().invoke(command, [str(tmp_path / "none")], catch_exceptions=False)
