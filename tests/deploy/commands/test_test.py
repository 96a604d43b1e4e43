"""How many tests ``elea test`` runs at a time."""

from __future__ import annotations

import pytest

from deploy.commands.diagnostics import parallel_arguments, worker_count

TWO = ["-n", "2", "--dist", "loadfile", "--no-loadscope-reorder"]


@pytest.mark.parametrize(
    "arguments", [[], ["tests/models", "-x"], ["-k", "panel"], ["tests/deploy/live", "tests/harness/ports.py"]]
)
def test_whole_folders_run_several_at_a_time(arguments: list[str]) -> None:
    assert parallel_arguments(arguments, 2) == TWO
    assert parallel_arguments(arguments, 64)[1] == "8"


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


@pytest.mark.parametrize(("processors", "tests"), [(1, 1), (2, 3), (4, 6), (6, 8), (64, 8)])
def test_more_tests_than_processors_run_at_a_time_since_they_wait(processors: int, tests: int) -> None:
    assert worker_count(processors) == tests
