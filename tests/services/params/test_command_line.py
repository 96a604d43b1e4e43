"""``elea param`` against the real service."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest
from click.shell_completion import ShellComplete

from deploy.commands import completion as live_completion
from deploy.commands.cli import elea
from tests.services.params.cli_harness import ParameterServiceProcess, RunCommand
from tests.services.params.parameter_client import value_dict

SET = "/robot_control"


def test_list_get_and_describe(param: RunCommand) -> None:
    said = param("list")
    assert f"{SET}  (followed by /arm, /reference)\n  reference_type\n  ref_angle\n" in said.out
    assert json.loads(param("list", "waypoint", "--json").out or "null") is None
    assert json.loads(param("list", "tb3_0/waypoint", "--json").out) == [
        {"set": "/tb3_0/waypoint", "nodes": ["/tb3_0/waypoint"], "parameters": ["ref_angle", "ss_Kp"]}
    ]
    assert param("get", "robot_control", "ref_angle").out == "30.0\n"
    assert param("get", "reference", "ref_angle").out == "30.0\n"
    assert "ref_angle       30.0" in param("get", SET).out
    values = json.loads(param("get", SET, "limits", "offset", "--json").out)["values"]
    assert values == {
        "limits": {"value": [-1.0, 1.0], "origin": "default"},
        "offset": {"value": None, "origin": "default"},
    }
    assert "-90 to 90 deg" in param("describe", "arm").out
    described = json.loads(param("describe", SET, "ref_angle", "--json").out)["parameters"][0]
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
def test_set_in_every_way_of_writing(
    param: RunCommand, service: ParameterServiceProcess, words: list[str], values: dict[str, Any]
) -> None:
    said = param("set", "robot_control", *words)
    assert said.status == 0, said
    assert repr(values.items() <= value_dict(service.client.get()).items()) == "True", service.client.get()
    changed = {each.name: each.origin for each in service.client.get().values if each.name in values}
    assert set(changed.values()) == {"run" if "--run" in words else "saved"}
    assert ("was clamped" in said.err) == ("--clamp" in words)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([SET, "ss_Kp", "99999999999999999999"], "ss_Kp = 1e+20: no number may exceed 1e+12"),
        ([SET, "ref_angle", "nan"], "ref_angle = nan: it is not finite"),
        ([SET, "window", "99999999999999999999"], "an int has 64 bits"),
        ([SET, "ref_angel", "1"], "unknown parameter 'ref_angel'; did you mean 'ref_angle'?"),
        ([SET, "ref_angle=1", "ref_angle=2"], "given twice"),
        ([SET, "{ref_angle: 1, ref_angle: 2}"], "given twice"),
        ([SET, "ref_angle"], "write NAME VALUE"),
        ([SET, "--clmap", "ref_angle=1"], "unknown option '--clmap'; did you mean '--clamp'?"),
        ([SET], "nothing to set"),
        (["/robot_contro", "ref_angle", "1"], "did you mean '/robot_control'?"),
        (["waypoint", "ref_angle", "1"], "one of several sets: choose one of /tb3_0/waypoint, /tb3_1/waypoint"),
    ],
)
def test_bad_input_ends_with_status_2(
    param: RunCommand, service: ParameterServiceProcess, words: list[str], says: str
) -> None:
    before = service.client.get()
    said = param("set", *words)
    assert said.status == 2
    assert says in said.err
    assert service.client.get() == before


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([SET, "ref_angle", "95"], "ref_angle = 95.0 is out of bounds: -90 to 90 deg"),
        ([SET, "ref_angle", "x"], "ref_angle = 'x': it is a text, expected float"),
        ([SET, "window", "1.5"], "it is a float, expected int"),
        ([SET, "feed_forward", "maybe"], "'maybe': it is a text, expected bool"),
        ([SET, "reference_type", "sin"], "expected one of step, sine"),
        ([SET, "file", "x"], "cannot change while /arm, /reference runs"),
        ([SET, "ref_angle=95", "window=0", "ss_Kp=1"], "nothing was changed"),
        ([SET, "limits", "[1, -2, 30]"], "limits[2] = 30.0 is out of bounds"),
    ],
)
def test_what_the_parameter_service_refuses_ends_with_status_1(
    param: RunCommand, service: ParameterServiceProcess, words: list[str], says: str
) -> None:
    before = service.client.get()
    said = param("set", *words)
    assert said.status == 1
    assert says in said.err
    assert service.client.get() == before


def test_reset_undo_and_history(param: RunCommand, service: ParameterServiceProcess) -> None:
    param("set", SET, "ref_angle=10", "ss_Kp=3")
    param("set", SET, "ref_angle", "11")
    assert f"{SET} ref_angle: 11.0 -> 30.0  (default)" in param("reset", SET, "ref_angle").out
    assert value_dict(service.client.get())["ss_Kp"] == 3.0
    assert "30.0 -> 11.0" in param("undo", SET).out
    assert "11.0 -> 10.0" in param("undo", SET).out
    changes = json.loads(param("history", SET, "-n", "3", "--json").out)
    assert [each["kind"] for each in changes] == ["undo", "undo", "reset"]
    assert changes[2]["undone"] is True
    assert "(param)" in changes[0]["who"]
    shown = param("history").out.splitlines()
    assert "undo" in shown[0]
    assert "ref_angle 11.0 -> 10.0" in shown[0]
    assert param("set", "/tb3_0/waypoint", "ss_Kp=7").status == 0
    undone = param("undo", "/tb3_0/waypoint")
    assert (undone.status, "ss_Kp: 7.0 -> " in undone.out) == (0, True)


def test_completion_knows_sets_and_parameters_and_gives_up_in_time(
    service: ParameterServiceProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    completion = ShellComplete(elea, {}, "elea", "_ELEA_COMPLETE")

    def of(*words: str, part: str, endpoint: str = service.network.endpoint) -> list[str]:
        return [each.value for each in completion.get_completions(["param", *words, "--connect", endpoint], part)]

    with monkeypatch.context() as patient:
        patient.setattr(live_completion, "TIMEOUT_S", 60.0)
        assert of("get", part="robot") == ["robot_control"]
        assert of("get", part="/tb3") == ["/tb3_0/waypoint", "/tb3_1/waypoint"]
        assert of("set", "robot_control", part="ref") == ["ref_angle", "reference_type"]
    began = time.monotonic()
    assert of("get", part="", endpoint="tcp/127.0.0.1:1") == []
    assert time.monotonic() - began < 8.0, "Zenoh alone would try for 10 s"
