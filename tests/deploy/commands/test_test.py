"""Which tests ``elea test`` runs, and how many in parallel."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.commands.diagnostics import are_external, parallel_arguments, path_from
from services.runtime.process import ROOT

TWO = ["--tx", "2*popen", "--dist", "loadfile", "--no-loadscope-reorder"]


@pytest.mark.parametrize(
    "arguments", [[], ["tests/models", "-x"], ["-k", "panel"], ["tests/deploy/live", "tests/harness/ports.py"]]
)
def test_whole_folders_run_several_at_a_time(arguments: list[str]) -> None:
    assert parallel_arguments(arguments, 2) == TWO
    assert parallel_arguments(arguments, 64)[1] == "8*popen"
    background = ["--tx", "popen//id=waiting1", "--tx", "popen//id=waiting2", "--tx", "popen//id=computing"]
    assert parallel_arguments(arguments, 2, background=True) == [*TWO[:2], *background, *TWO[2:]]


@pytest.mark.parametrize(
    "arguments",
    [
        ["-n", "2"],
        ["-n0", "tests/deploy/live"],
        ["--numprocesses=3"],
        ["-p", "no:xdist"],
        ["tests/system/test_lab.py"],
        ["tests/system/test_lab.py::test_without_waiting", "-v"],
        ["tests/nowhere.py"],
        ["tests/deploy/live", "-s"],
        ["--pdb"],
        ["--co", "-q"],
        ["--capture=no"],
    ],
)
def test_who_names_files_or_a_number_gets_that(arguments: list[str]) -> None:
    assert parallel_arguments(arguments, 2) == []


def test_paths_count_from_the_current_folder_else_from_the_project(tmp_path: Path) -> None:
    (tmp_path / "test_mine.py").touch()
    (tmp_path / "lockstep").mkdir()
    assert path_from("test_mine.py::test_it", tmp_path) == f"{tmp_path}/test_mine.py::test_it"
    assert path_from("./lockstep", tmp_path) == f"{tmp_path / 'lockstep'}"
    for kept in ("lockstep", "tests/models", "-x", "--junitxml=test_mine.py", f"{tmp_path}/test_mine.py"):
        assert path_from(kept, tmp_path) == kept


def test_tests_outside_of_the_project_are_not_asked_for_its_markers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    assert are_external([f"{tmp_path}::test_it", "-x"])
    assert are_external(["deploy", "-k", "lockstep"]), "a file of one's own in the checkout"
    for ours in ([], ["tests/models", str(tmp_path)], ["-k", "lockstep"], [str(ROOT)], ["tests"]):
        assert not are_external(ours), ours
