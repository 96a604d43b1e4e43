"""``elea param`` against the real service."""

from __future__ import annotations

import json
import signal
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from click.shell_completion import ShellComplete

from deploy.commands.cli import elea, main
from messages.parameters import HistoryOf
from messages.requests import PARAMS_HISTORY
from services.runtime.calls import call
from tests.params.sets import ARM, Asking, arm, asking, plain, serving
from tests.processes import Network, Process

SET = "/robot_control"


class Said(NamedTuple):
    """Exit status, standard output and errors of a command line."""

    status: int
    out: str
    err: str


Line = Callable[..., Said]


class Bench(NamedTuple):
    """A network with the service, and who announces."""

    network: Network
    service: Process
    client: Asking
    file: Path


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("param")
    with Network(folder) as network, asking(network) as client:
        service = serving(network, client, folder / "params.db")
        client.announce(arm(node="/arm"))
        client.announce(arm(node="/reference", parameters=ARM[:2]))
        for robot in ("tb3_0", "tb3_1"):
            client.announce(arm(f"/{robot}/waypoint", f"/{robot}/waypoint", parameters=ARM[1:3]))
        yield Bench(network, service, client, folder)


@pytest.fixture
def line(bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Line]:
    """``elea param VERB ...`` in this process; every set is as announced before and after."""

    def run(verb: str, *words: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["elea", "param", verb, "--connect", bench.network.endpoint, *words])
        capsys.readouterr()
        status: Any = 0
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
        return Said(status, *capsys.readouterr())

    yield run
    for name in (SET, "/tb3_0/waypoint", "/tb3_1/waypoint"):
        run("reset", name)


def test_list_get_and_describe(line: Line) -> None:
    said = line("list")
    assert f"{SET}  (followed by /arm, /reference)\n  reference_type\n  ref_angle\n" in said.out
    assert json.loads(line("list", "waypoint", "--json").out or "null") is None
    assert json.loads(line("list", "tb3_0/waypoint", "--json").out) == [
        {"set": "/tb3_0/waypoint", "nodes": ["/tb3_0/waypoint"], "parameters": ["ref_angle", "ss_Kp"]}
    ]
    assert line("get", "robot_control", "ref_angle").out == "30.0\n"
    assert line("get", "reference", "ref_angle").out == "30.0\n"
    assert "ref_angle       30.0" in line("get", SET).out
    values = json.loads(line("get", SET, "limits", "offset", "--json").out)["values"]
    assert values == {
        "limits": {"value": [-1.0, 1.0], "origin": "default"},
        "offset": {"value": None, "origin": "default"},
    }
    assert "-90 to 90 deg" in line("describe", "arm").out
    described = json.loads(line("describe", SET, "ref_angle", "--json").out)["parameters"][0]
    assert (described["low"], described["unit"], described["text"]) == (-90.0, "deg", "where to be")


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (["ref_angle", "-12"], {"ref_angle": -12.0}),
        (["ref_angle=1e1", "reference_type=SINE"], {"ref_angle": 10.0, "reference_type": "sine"}),
        (["feed_forward", "Yes"], {"feed_forward": True}),
        (["feed_forward=t", "window=7"], {"feed_forward": True, "window": 7}),
        (
            ["{ref_angle: 5, feed_forward: on, limits: [1, 2.5], ss_Kp: 1e2}"],
            {"ref_angle": 5.0, "feed_forward": True, "limits": (1.0, 2.5), "ss_Kp": 100.0},
        ),
        (["limits", "[3, 4]"], {"limits": (3.0, 4.0)}),
        (["offset=2", "window=3"], {"offset": 2.0}),
        (["offset=null", "window=3"], {"offset": None}),
        (["--clamp", "ref_angle", "400"], {"ref_angle": 90.0}),
        (["--run", "ref_angle", "4"], {"ref_angle": 4.0}),
    ],
)
def test_set_in_every_way_of_writing(line: Line, bench: Bench, words: list[str], values: dict[str, Any]) -> None:
    said = line("set", "robot_control", *words)
    assert said.status == 0, said
    assert repr(values.items() <= plain(bench.client.get()).items()) == "True", bench.client.get()
    changed = {each.name: each.origin for each in bench.client.get().values if each.name in values}
    assert set(changed.values()) == {"run" if "--run" in words else "saved"}
    assert ("was clamped" in said.err) == ("--clamp" in words)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([SET, "ref_angle", "95"], "ref_angle = 95.0 is out of bounds: -90 to 90 deg"),
        ([SET, "ref_angle", "nan"], "ref_angle = nan: it is not finite"),
        ([SET, "ref_angle", "x"], "ref_angle = 'x': it is a text, expected float"),
        ([SET, "window", "1.5"], "it is a float, expected int"),
        ([SET, "feed_forward", "maybe"], "'maybe': it is a text, expected bool"),
        ([SET, "reference_type", "sin"], "expected one of step, sine"),
        ([SET, "ref_angel", "1"], "unknown parameter 'ref_angel'; did you mean 'ref_angle'?"),
        ([SET, "file", "x"], "cannot change while /arm, /reference runs"),
        ([SET, "ref_angle=1", "ref_angle=2"], "given twice"),
        ([SET, "{ref_angle: 1, ref_angle: 2}"], "given twice"),
        ([SET, "ref_angle"], "write NAME VALUE"),
        ([SET, "--clmap", "ref_angle=1"], "unknown option '--clmap'; did you mean '--clamp'?"),
        ([SET], "nothing to set"),
        (["/robot_contro", "ref_angle", "1"], "did you mean '/robot_control'?"),
        (["waypoint", "ref_angle", "1"], "one of several sets: say which, /tb3_0/waypoint, /tb3_1/waypoint"),
        ([SET, "ref_angle=95", "window=0", "ss_Kp=1"], "nothing was changed"),
    ],
)
def test_bad_input_is_refused_with_status_2(line: Line, bench: Bench, words: list[str], says: str) -> None:
    before = bench.client.get()
    said = line("set", *words)
    assert said.status == 2
    assert says in said.err
    assert bench.client.get() == before


def test_reset_undo_and_history(line: Line, bench: Bench) -> None:
    line("set", SET, "ref_angle=10", "ss_Kp=3")
    line("set", SET, "ref_angle", "11")
    assert f"{SET} ref_angle: 11.0 -> 30.0  (default)" in line("reset", SET, "ref_angle").out
    assert plain(bench.client.get())["ss_Kp"] == 3.0
    assert "30.0 -> 11.0" in line("undo", SET).out
    assert "11.0 -> 10.0" in line("undo", SET).out
    changes = json.loads(line("history", SET, "-n", "3", "--json").out)
    assert [each["kind"] for each in changes] == ["undo", "undo", "reset"]
    assert changes[2]["undone"] is True
    assert "(param)" in changes[0]["who"]
    shown = line("history").out.splitlines()
    assert "undo" in shown[0]
    assert "ref_angle 11.0 -> 10.0" in shown[0]
    assert line("undo", "/tb3_0/waypoint").status in (0, 1)


@pytest.mark.parametrize("form", ["yaml", "toml"])
def test_what_is_dumped_can_be_loaded(line: Line, bench: Bench, tmp_path: Path, form: str) -> None:
    file = tmp_path / f"values.{form}"
    line("set", SET, "ref_angle=10", "reference_type=sine", "limits=[1,2]", "feed_forward=yes", "offset=-0.5")
    line("set", "tb3_1/waypoint", "ss_Kp", "8")
    held = {name: plain(bench.client.get(name)) for name in (SET, "/tb3_0/waypoint", "/tb3_1/waypoint")}
    assert line("dump", "-o", str(file)).status == 0
    text = file.read_text()
    table = yaml.safe_load(text) if form == "yaml" else tomllib.loads(text)
    assert table[SET]["limits"] == [1.0, 2.0]
    assert "file" not in table[SET]
    for name in held:
        line("reset", name)
    said = line("load", str(file))
    assert said.status == 0, said
    assert f"{SET} ref_angle: 30.0 -> 10.0  (saved)" in said.out
    assert f"{SET}: 5 changed, 3 as before" in said.out
    assert {name: plain(bench.client.get(name)) for name in held} == held
    history = call(bench.client.transport, PARAMS_HISTORY, "params/history", HistoryOf(set=SET, limit=1)).changes
    assert history[0].kind == "load"
    assert "0 changed, 8 as before" in line("load", str(file)).out


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.yaml", "/robot_control: {ref_angle: 1}\n/tb3_0/waypoint: {ref_angle: 99}", "Nothing was changed"),
        ("a.yaml", "/robot_control: {ref_angle: 1}\n/arn: {x: 1}", "unknown set of parameters '/arn'"),
        ("a.yaml", "/robot_control: {ref_angle: 1\n", "line 2"),
        ("a.yaml", "a: 1\na: 2\n", "line 2: a is given twice"),
        ("a.yaml", "ref_angle: 1", "if the file has the values of one set, say --set SET"),
        ("a.yaml", "/robot_control: {ref_angle: .nan}", "ref_angle = nan: it is not finite"),
        ("a.yaml", "/robot_control: {ref_angle: {x: 1}}", "a parameter is a bool, number, text or list"),
        ("a.toml", "[robot_control]\nref_angle = = 1", "line 2"),
        ("a.txt", "", "is it YAML or TOML?"),
    ],
)
def test_a_file_that_is_not_right_changes_nothing(
    line: Line, bench: Bench, tmp_path: Path, name: str, text: str, says: str
) -> None:
    (tmp_path / name).write_text(text)
    before = bench.client.get()
    said = line("load", str(tmp_path / name))
    assert said.status == 2
    assert says in said.err
    assert bench.client.get() == before


def test_a_file_of_one_set(line: Line, bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text("ref_angle: 7\nfeed_forward: yes\n")
    assert line("load", str(tmp_path / "arm.yaml"), "--set", "robot_control", "--run").status == 0
    assert plain(bench.client.get())["ref_angle"] == 7.0
    assert "cannot read" in line("load", str(tmp_path / "none.yaml")).err


def test_completion_knows_sets_and_parameters_and_gives_up_in_time(bench: Bench) -> None:
    completion = ShellComplete(elea, {}, "elea", "_ELEA_COMPLETE")

    def of(*words: str, part: str, endpoint: str = bench.network.endpoint) -> list[str]:
        return [each.value for each in completion.get_completions(["param", *words, "--connect", endpoint], part)]

    assert of("get", part="robot") == ["robot_control"]
    assert of("get", part="/tb3") == ["/tb3_0/waypoint", "/tb3_1/waypoint"]
    assert of("set", "robot_control", part="ref") == ["ref_angle", "reference_type"]
    began = time.monotonic()
    assert of("get", part="", endpoint="tcp/127.0.0.1:1") == []
    assert time.monotonic() - began < 1.0


def test_an_answer_that_does_not_come_is_told_as_it_is(line: Line, bench: Bench) -> None:
    """Last in this module: the service is stopped for a while, then gone."""
    bench.service.signal(signal.SIGSTOP)
    try:
        said = line("list", "-t", "0.5")
    finally:
        bench.service.signal(signal.SIGCONT)
    assert said.status == 1
    assert "unknown whether the request was carried out" in said.err
    assert line("set", SET, "ref_angle", "3").status == 0
    bench.service.kill()
    said = line("set", SET, "ref_angle", "4")
    assert said.status == 1
    assert "nobody serves /params/list, nothing was asked" in said.err
