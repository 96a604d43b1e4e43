"""A sweep without its runs: axes, input rejected before anything starts, its folder, table and picture."""

from __future__ import annotations

import asyncio
import csv
import io
import os
import signal
from pathlib import Path
from typing import Any

import msgspec
import pyarrow.parquet
import pytest
from PIL import Image

from deploy import INTERRUPTED
from deploy.commands.sweep import check_definition, command
from deploy.report.record import REPORT_FILE, RunFacts
from deploy.report.write import build_report, to_json
from deploy.sweep.definition import SEED, Axis, Definition, read_axes
from deploy.sweep.picture import choose_axis, draw, make_lines
from deploy.sweep.results import RESULT_FILE, Result, Row, check_figure, make_row, unit_of, write_tables
from deploy.sweep.runner import Sweep, open_folder, pending_runs, read_definition, run_folder
from services.grader.records import Measurements
from services.runtime.errors import BadInput

FLEET = """\
name = "one"
[run]
ends = "duration"
duration = 2
[[robot]]
name = "tb3_0"
model = "burger"
services = [{ kind = "waypoint" }]
"""


def swept(*assignments: str, seeds: str = "") -> Definition:
    return Definition(fleet="one.toml", digest="", axes=read_axes(seeds, assignments))


def test_every_combination_is_a_run_of_up() -> None:
    sweep = swept("/tb3_0/waypoint  max_linear=0.1,0.2", "run.latency=1", seeds="0..2,7")
    assert [each.name for each in sweep.varied] == ["/tb3_0/waypoint.max_linear", SEED]
    assert len(sweep.runs) == 8
    assert sweep.arguments(sweep.runs[5]) == (
        ["one.toml", "--set", "/tb3_0/waypoint max_linear=0.2", "--set", "run.latency=1", "--seed", "1"]
    )
    lists = swept("waypoint.goals=[[1, 0], [2, 0]],[[0, 1]]", 'model="a,b",c')
    assert [each.values for each in lists.axes] == [("[[1, 0], [2, 0]]", "[[0, 1]]"), ('"a,b"', "c")]


def test_what_is_no_sweep_is_refused() -> None:
    for (seeds, *assignments), what in {
        ("3..1",): "ends before it begins",
        ("a",): "neither a seed nor a range",
        ("1,1",): "1 is given twice",
        ("", "model"): "is not an assignment",
        ("", "model="): "a value is empty",
        ("", "model=a", "model=b"): "gives model twice",
        ("0..9999", "run.latency=0,1"): "20000 combinations: a sweep has at most 10000 runs",
    }.items():
        with pytest.raises(BadInput, match=what):
            swept(*assignments, seeds=seeds)


def test_every_combination_is_checked_before_anything_starts(tmp_path: Path) -> None:
    fleet = tmp_path / "one.toml"
    fleet.write_text(FLEET)
    folder = tmp_path / "results"
    for arguments, what in {
        ("--set", "/tb3_0/waypoint max_linear=0.1,9"): "max_linear",
        ("--set", "/tb3_0/waypoint max_liner=0.1"): "did you mean 'max_linear'",
        ("--set", "/tb3_1/waypoint max_linear=0.1"): "/tb3_0/waypoint",
        ("--set", "run.latency=0,2"): "latency",
        ("--set", "tb3_0.model=burger,wafle"): "did you mean 'waffle'",
        ("--seeds", "0..1", "--plot", "tb3_0.path_lenght_m"): "did you mean 'tb3_0.path_length_m'",
        ("--seeds", "0..1", "--plot", "path_length_m"): "say whose, e.g. tb3_0.path_length_m",
        ("--seeds", "0..1", "--plot", "sim_seconds", "--over", "sead"): "did you mean 'seed'",
        ("--plot", "sim_seconds"): "nothing was varied",
        ("--set", 'run.ends="never","duration"'): "never ends by itself",
    }.items():
        with pytest.raises(BadInput) as caught:
            command.main([str(fleet), "--report", str(folder), *arguments], standalone_mode=False)
        assert what in str(caught.value), arguments
    assert not folder.exists()


def test_a_folder_goes_on_with_its_own_sweep_alone(tmp_path: Path) -> None:
    sweep, other = swept("run.latency=0,1", seeds="1"), swept("run.latency=0", seeds="1")
    with open_folder(tmp_path / "a", sweep):
        with pytest.raises(BadInput, match="sweep is using"), open_folder(tmp_path / "a", sweep):
            raise AssertionError
        assert read_definition(tmp_path / "a") == sweep
        first, second = pending_runs(tmp_path / "a", sweep)
        ended = run_folder(tmp_path / "a", first)
        ended.mkdir(parents=True)
        (ended / RESULT_FILE).write_bytes(msgspec.json.encode(Result(status=75, seconds=1.0, error="no room")))
        assert pending_runs(tmp_path / "a", sweep) == [second]
        assert pending_runs(tmp_path / "a", sweep, again=True) == [first, second], "it has no report"
    with pytest.raises(BadInput, match="holds another sweep: its axes differ"), open_folder(tmp_path / "a", other):
        raise AssertionError
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "thesis.tex").touch()
    with pytest.raises(BadInput, match="holds something other"), open_folder(tmp_path / "b", sweep):
        raise AssertionError


def test_a_changed_fleet_is_another_sweep(tmp_path: Path) -> None:
    fleet = tmp_path / "one.toml"
    fleet.write_text(FLEET)
    with pytest.raises(BadInput, match="has changed since this sweep began"):
        check_definition(Definition(fleet=str(fleet), digest="0", axes=read_axes("1", ())))


def test_a_run_is_a_row_with_or_without_a_report(tmp_path: Path) -> None:
    sweep = swept("run.latency=0,1", seeds="4")
    first, second = sweep.runs
    measured = Measurements(
        sim_seconds=2.0, ended="goals", trajectory_hash="ab", messages_lost=3, onlookers_lost={}, robots={}
    )
    facts = RunFacts(fleet="one", mode="lockstep", seed=4, version="0", wall_seconds=4.0)
    (tmp_path / "1").mkdir()
    (tmp_path / "1" / REPORT_FILE).write_bytes(to_json(build_report(measured, facts, {})))
    rows = [
        make_row(first, tmp_path / "1", Result(status=1, seconds=4.0)),
        make_row(second, tmp_path / "2", Result(status=-9, seconds=1.0, error="the sim was killed")),
    ]
    write_tables(sweep, rows, tmp_path)
    table = list(csv.DictReader(io.StringIO((tmp_path / "sweep.csv").read_text())))
    assert [each["run.latency"] for each in table] == ["0", "1"]
    assert (table[0]["messages_lost"], table[0]["trajectory_hash"], table[0]["status"]) == ("3", "ab", "1")
    assert (table[1]["messages_lost"], table[1]["error"], table[1]["status"]) == ("", "the sim was killed", "-9")
    columns = pyarrow.parquet.read_table(tmp_path / "sweep.parquet").to_pydict()
    assert columns["seed"] == [4.0, 4.0]
    assert columns["real_time_factor"] == [0.5, None]


def test_a_picture_has_a_line_for_each_of_the_other_values_and_the_spread_of_seeds() -> None:
    sweep = swept("a.Kp=1,2", "a.Kd=3,10,5", seeds="0,1")
    rows: list[Row] = [
        {**each.values, "arm.step_settling_s": float(each.values["a.Kd"]) + int(each.values[SEED])}
        for each in sweep.runs
        if each.values["a.Kd"] != "10" or each.values["a.Kp"] == "1"
    ]
    assert choose_axis(sweep, "").name == "a.Kp"
    axis = choose_axis(sweep, "a.Kd")
    lines = make_lines(sweep, rows, "arm.step_settling_s", axis)
    assert [each.label for each in lines] == ["a.Kp 1", "a.Kp 2"]
    assert lines[0].places == (3.0, 5.0, 10.0), "in the order of the numbers"
    assert lines[0].values == ((3.0, 4.0), (5.0, 6.0), (10.0, 11.0))
    assert lines[1].places == (3.0, 5.0)
    drawn = Image.open(io.BytesIO(draw(sweep, rows, "arm.step_settling_s", "a.Kd")))
    assert drawn.format == "PNG"
    assert unit_of("arm.step_settling_s") == "s"
    with pytest.raises(BadInput, match="did you mean 'arm"):
        draw(sweep, rows, "arm.step_setling_s", "a.Kd")


def test_a_run_that_is_being_started_is_interrupted_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    definition = swept(seeds="1")
    signals: list[int] = []

    class Process:
        def send_signal(self, number: int) -> None:
            signals.append(number)

        async def wait(self) -> int:
            return INTERRUPTED

    async def start(*_: Any, **__: Any) -> Process:
        os.kill(os.getpid(), signal.SIGINT)
        while not sweep.interrupted:
            await asyncio.sleep(0)
        return Process()

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
    sweep = Sweep(tmp_path, definition, 1, lambda *_: None)
    asyncio.run(sweep.run(definition.runs))
    assert signals == [signal.SIGINT]


def test_words_are_drawn_in_their_order() -> None:
    axis = Axis(key="model", values=("waffle", "burger"))
    sweep = Definition(fleet="lab", digest="", axes=(axis,))
    rows: list[Row] = [{"model": "burger", "lag_s": 1}, {"model": "waffle", "lag_s": 2}]
    assert make_lines(sweep, rows, "lag_s", axis)[0].places == (0.0, 1.0)
    check_figure("/tb3_0/referee.score", (), "--plot")
