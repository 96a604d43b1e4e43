"""The report: its schema, its bounds, its table and its picture, made from a simulated run."""

from __future__ import annotations

import io
import json
import os
import re
from pathlib import Path

import jsonschema
import msgspec
import pytest

from deploy.report import schema
from deploy.report.bounds import Bound, Bounds, check_bounds
from deploy.report.record import PICTURE_FILE, REPORT_FILE, Report, RunFacts
from deploy.report.table import show
from deploy.report.write import compose, read_measurements, to_json, write_report
from services.grader.folder import prepare, write_whole
from services.grader.records import Ended, Measurements
from services.grader.store import store
from services.runtime.errors import BadInput
from tests.report.simulated import judged, robot

NAMES = ("tb3_0", "tb3_1")
FACTS = RunFacts(fleet="lab", mode="lockstep", seed=1, version="0.1.0", wall_seconds=50.0, restarts=0)
ISSUED_RUN = "fleet mode sim_seconds wall_seconds real_time_factor seed version trajectory_hash messages_lost restarts"
ISSUED_ROBOT = (
    "points points_reached cross_track_rms_m cross_track_max_m odometry_error_max_m path_length_m min_distance_m "
    "collisions commands_timed_out"
)


def put_run(folder: Path, end: float = 400.0, ended: Ended = "goals") -> Path:
    run = judged([post for shift, name in enumerate(NAMES) for post in robot(name, 0.5 * shift)], NAMES, end)
    store(prepare(folder), run.measurements(ended), run.robots)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return put_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def measured(folder: Path) -> Measurements:
    return read_measurements(folder)


def test_the_report_of_a_run_fits_its_schema_and_holds_the_promised_keys(folder: Path) -> None:
    report = write_report(folder, FACTS, {})
    tree = json.loads((folder / REPORT_FILE).read_text())
    jsonschema.Draft202012Validator(schema.schema()).validate(tree)
    assert tree["schema"] == 1
    assert tree["ok"] is report.ok is True
    assert set(ISSUED_RUN.split()) <= set(tree["run"])
    assert set(tree["robots"]) == set(NAMES)
    for figures in tree["robots"].values():
        assert set(ISSUED_ROBOT.split()) <= set(figures)
    assert all({"name", "value", "bound", "ok"} <= set(each) for each in tree["checks"])
    assert tree["run"]["real_time_factor"] == pytest.approx(8.0)


def test_the_schema_refuses_a_report_without_a_key(folder: Path, measured: Measurements) -> None:
    tree = json.loads(to_json(compose(measured, FACTS, {})))
    del tree["robots"]["tb3_0"]["collisions"]
    with pytest.raises(jsonschema.ValidationError) as refused:
        jsonschema.Draft202012Validator(schema.schema()).validate(tree)
    assert any("collisions" in each.message for each in refused.value.context or ())


def test_the_schema_file_is_that_of_the_records_and_every_key_is_documented() -> None:
    assert schema.SCHEMA_FILE.read_text() == schema.text()
    text = schema.SCHEMA_FILE.with_name("README.md").read_text()
    definitions = schema.schema()["$defs"]
    records = {"RunFigures": "run.", "RobotFigures": "robots.*.", "CornerFigures": "robots.*.corners.*."}
    records |= {"ArmFigures": "robots.*.", "StepFigures": "robots.*.steps.*."}
    for record, prefix in {**records, "Check": "checks.*.", "Effective": "parameters.*.*.", "Report": ""}.items():
        for key in definitions[record]["properties"]:
            assert re.search(rf"`{re.escape(prefix + key)}[`.]", text), prefix + key


def test_the_picture_is_a_png_of_a_readable_size(folder: Path) -> None:
    write_report(folder, FACTS, {})
    head = (folder / PICTURE_FILE).read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    assert int.from_bytes(head[16:20]) >= 1200


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
    report = compose(measured, FACTS, bounds)
    assert [each.name for each in report.checks if not each.ok] == missed
    assert report.ok == (not missed)


def test_without_bounds_points_collisions_and_losses_are_checked(measured: Measurements) -> None:
    first = msgspec.structs.replace(measured.robots["tb3_0"], collisions=1, points_reached=2)
    spoiled = msgspec.structs.replace(measured, messages_lost=3, robots={**measured.robots, "tb3_0": first})
    report = compose(spoiled, FACTS, {})
    assert not report.ok
    assert {each.name: each.value for each in report.checks if not each.ok} == {
        "tb3_0.points_reached": 2,
        "tb3_0.collisions": 1,
        "messages_lost": 3,
    }


def test_what_was_not_measured_misses_its_bound_but_for_the_distance_of_a_lone_robot(measured: Measurements) -> None:
    alone = msgspec.structs.replace(measured.robots["tb3_0"], min_distance_m=None, cross_track_rms_m=None)
    lonely = msgspec.structs.replace(measured, robots={"tb3_0": alone})
    report = compose(lonely, FACTS, {"min_distance_m": Bound(min=0.3), "cross_track_rms_m": 0.01})
    assert [each.name for each in report.checks if not each.ok] == ["tb3_0.cross_track_rms_m"]


def test_a_bound_on_nothing_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(BadInput, match=r"fleet\.toml.*did you mean 'cross_track_rms_m'"):
        check_bounds({"cross_track_rsm_m": 0.1}, "fleet.toml")
    with pytest.raises(BadInput, match="min, max or both"):
        check_bounds({"collisions": Bound()}, "fleet.toml")
    check_bounds({"collisions": 0, "real_time_factor": Bound(min=1)}, "fleet.toml")


def test_a_run_stopped_half_way_gives_a_partial_report(tmp_path: Path) -> None:
    report = write_report(put_run(tmp_path, end=5.0, ended="stopped"), FACTS, {})
    assert report.run.ended == "stopped"
    assert report.run.sim_seconds == 5
    assert not report.ok
    assert report.robots["tb3_0"].points_reached < report.robots["tb3_0"].points
    assert report.robots["tb3_0"].time_s is None


def test_a_run_of_which_nothing_was_seen_is_drawn_but_does_not_pass(tmp_path: Path) -> None:
    run = judged([], NAMES)
    store(tmp_path, run.measurements("stopped"), run.robots)
    report = write_report(tmp_path, FACTS, {})
    assert [each.name for each in report.checks if not each.ok] == ["tb3_0.samples", "tb3_1.samples"]
    assert (tmp_path / PICTURE_FILE).exists()


def test_a_piped_table_is_plain_and_tells_every_robot_and_miss(measured: Measurements) -> None:
    out = io.StringIO()
    show(compose(measured, FACTS, {"collisions": -1}), out)
    text = out.getvalue()
    assert "\x1b" not in text
    assert text.isascii()
    assert "tb3_0     3/3" in text
    assert "missed: tb3_1.collisions is 0, should be at most -1" in text
    assert "FAILED: 5 of 7 checks hold" in text


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_of_80_columns_the_table_is_complete_too(
    measured: Measurements, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    out = Terminal()
    show(compose(measured, FACTS, {"cross_track_max_m": 1e-9}), out)
    assert "…" not in out.getvalue()
    for text in ("tb3_0", "3/3", "missed: tb3_1.cross_track_max_m", "FAILED"):
        assert text in out.getvalue()


def test_no_measurements_is_said_plainly(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="the grader ended before the run"):
        write_report(tmp_path, FACTS, {})
    (tmp_path / "measurements.json").write_text('{"ended": "goals"}')
    with pytest.raises(BadInput, match="sim_seconds"):
        read_measurements(tmp_path)


def test_a_folder_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("")
    with pytest.raises(BadInput, match="cannot be written"):
        prepare(occupied / "run")
    with pytest.raises(BadInput, match="cannot be written"):
        write_whole(tmp_path / "missing" / "report.json", b"{}")
    assert os.listdir(tmp_path) == ["file"]


def test_the_report_can_be_read_back(measured: Measurements) -> None:
    report = compose(measured, FACTS, {})
    assert msgspec.json.decode(to_json(report), type=Report) == report
