"""``elea param dump`` and ``load`` against the real service, and a missing reply."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import yaml

from messages.parameters import HistoryOf
from messages.requests import PARAMS_HISTORY, PARAMS_LIST
from services.runtime.graph import Entity, token_pattern
from services.runtime.requests import call
from tests.harness.waiting import wait_until
from tests.services.params.cli_harness import ParameterServiceProcess, RunCommand
from tests.services.params.parameter_client import connected_client, value_dict

SET = "/robot_control"


@pytest.mark.parametrize("form", ["yaml", "toml"])
def test_what_is_dumped_can_be_loaded(
    param: RunCommand, service: ParameterServiceProcess, tmp_path: Path, form: str
) -> None:
    file = tmp_path / f"values.{form}"
    param("set", SET, "ref_angle=10", "reference_type=sine", "limits=[1,2]", "feed_forward=yes", "offset=-0.5")
    param("set", "tb3_1/waypoint", "ss_Kp", "8")
    held = {name: value_dict(service.client.get(name)) for name in (SET, "/tb3_0/waypoint", "/tb3_1/waypoint")}
    assert param("dump", "-o", str(file)).status == 0
    text = file.read_text()
    table = yaml.safe_load(text) if form == "yaml" else tomllib.loads(text)
    assert table[SET]["limits"] == [1.0, 2.0]
    assert "file" not in table[SET]
    for name in held:
        param("reset", name)
    said = param("load", str(file))
    assert said.status == 0, said
    assert f"{SET} ref_angle: 30.0 -> 10.0  (saved)" in said.out
    assert f"{SET}: 5 changed, 3 as before" in said.out
    assert {name: value_dict(service.client.get(name)) for name in held} == held
    history = call(service.client.transport, PARAMS_HISTORY, "params/history", HistoryOf(set=SET, limit=1)).changes
    assert history[0].kind == "load"
    assert "0 changed, 8 as before" in param("load", str(file)).out


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.yaml", "/robot_control: {ref_angle: 1}\n/tb3_0/waypoint: {ref_angle: 99}", "Nothing was changed"),
        ("a.yaml", "/robot_control: {ref_angle: 1}\n/arn: {x: 1}", "unknown set of parameters '/arn'"),
        ("a.yaml", "/robot_control: {ref_angle: 1\n", "line 2"),
        ("a.yaml", "a: 1\na: 2\n", "line 2: a is given twice"),
        ("a.yaml", "ref_angle: 1", "if the file holds the values of one set, give --set SET"),
        ("a.yaml", "/robot_control: {ref_angle: .nan}", "ref_angle = nan: it is not finite"),
        ("a.yaml", "/robot_control: {ref_angle: {x: 1}}", "a parameter is a bool, number, text or list"),
        ("a.yaml", "/robot_control: {ref_angle: 1, ref_angel: 2}", "unknown parameter 'ref_angel'; did you mean"),
        ("a.yaml", "/robot_control: {ref_angle: 1}\nrobot_control: {ref_angle: 2}", "are given twice, under two names"),
        ("a.yaml", "/robot_control: {7: 1}", "unknown parameter '7'"),
        ("a.yaml", "/robot_control: {window: 99999999999999999999}", "an int has 64 bits"),
        ("a.yaml", f"/robot_control: {{ss_Kp: 1{'0' * 400}}}", "no number may exceed"),
        ("a.toml", "[robot_control]\nref_angle = = 1", "line 2"),
        ("a.txt", "", "is it YAML or TOML?"),
    ],
)
def test_a_file_that_is_not_right_changes_nothing(
    param: RunCommand, service: ParameterServiceProcess, tmp_path: Path, name: str, text: str, says: str
) -> None:
    (tmp_path / name).write_text(text)
    before = service.client.get()
    said = param("load", str(tmp_path / name))
    assert said.status == 2
    assert says in said.err
    assert service.client.get() == before


def test_a_file_of_one_set(param: RunCommand, service: ParameterServiceProcess, tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text("ref_angle: 7\nfeed_forward: yes\n")
    assert param("load", str(tmp_path / "arm.yaml"), "--set", "robot_control", "--run").status == 0
    assert value_dict(service.client.get())["ref_angle"] == 7.0
    assert "cannot read" in param("load", str(tmp_path / "none.yaml")).err


def test_an_answer_that_does_not_come_is_told_as_it_is(param: RunCommand, service: ParameterServiceProcess) -> None:
    """A service is mute at first, in a domain of its own, then the real one is gone."""
    pattern = token_pattern("srv", "*", PARAMS_LIST.name)
    with connected_client(service.network, "mute") as mute, connected_client(service.network, "mute") as other:
        server = mute.transport.serve(PARAMS_LIST.name[1:])
        token = mute.transport.declare_token(Entity(mute.transport.session, "srv", "/params", PARAMS_LIST.name).key)
        wait_until(lambda: other.transport.tokens(pattern), what="the mute service")
        said = param("list", "-t", "2", "--domain", "mute")
        token.close()
        server.close()
    assert said.status == 1
    assert "unknown whether the request was carried out" in said.err
    assert param("set", SET, "ref_angle", "3").status == 0
    service.service.kill()
    wait_until(lambda: not service.client.transport.tokens(pattern, 60.0), what="the end of the service")
    said = param("set", SET, "ref_angle", "4")
    service.start()
    assert said.status == 1
    assert "no server for /params/list, nothing was sent" in said.err
    assert value_dict(service.client.get())["ref_angle"] == 3.0
