"""``elea rostest`` without its fleets: the options of the tests, and an interrupt."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from deploy import INTERRUPTED, run_fleet
from deploy.commands import rostest
from services.runtime.errors import BadInput
from tests.deploy.launch.launch_harness import LaunchWorkspace

TESTS = """
<test test-name="one" pkg="talks" type="talker.py" args="a"/>
<test test-name="two" pkg="talks" type="talker.py"/>
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A launch file with two tests."""
    workspace = LaunchWorkspace(tmp_path)
    monkeypatch.chdir(workspace.source)
    monkeypatch.setenv("ELEA_HOME", str(tmp_path / "home"))
    return workspace.launch_file(TESTS, "talks/test/both.test")


def test_an_interrupt_ends_the_command(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []

    def interrupted(fleet: Any, *_: Any) -> Any:
        begun.append(fleet.name)
        return SimpleNamespace(outcome=SimpleNamespace(ended="interrupted", reason="it was interrupted"))

    monkeypatch.setattr(run_fleet, "run_fleet", interrupted)
    ended = CliRunner().invoke(rostest.command, [str(file), "--runs", str(file.parent / "runs")])
    assert ended.exit_code == INTERRUPTED
    assert len(begun) == 1


def test_the_folder_of_results_may_have_a_space_in_its_name(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments: list[list[str]] = []

    def run(fleet: Any, *_: Any) -> None:
        arguments.extend(list(each.args) for each in fleet.service if each.kind.endswith("talker.py"))

    monkeypatch.setattr(rostest, "_run", run)
    results = tmp_path / "my results"
    ended = CliRunner().invoke(rostest.command, [str(file), "--xunit", str(results)])
    assert (ended.exit_code, ended.output.count("passed")) == (0, 2)
    assert [each[:-1] for each in arguments] == [["a"], []]
    assert [each[-1] for each in arguments] == [f"--gtest_output=xml:{results}/{name}.xml" for name in ("one", "two")]
    with pytest.raises(BadInput, match=r"--xunit: the folder .* cannot be made"):
        rostest.command.main([str(file), "--xunit", str(file)], standalone_mode=False)
