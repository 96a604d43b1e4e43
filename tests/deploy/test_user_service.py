"""A fleet file that names a user's Python file: its declaration, errors, and a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from deploy.fleet_file import read_fleet
from deploy.processes import plan_processes
from deploy.service_parameters import RunOptions
from services.runtime.errors import BadInput
from services.runtime.parameters.schema import flatten
from services.runtime.parameters.validation import build, describe_parameters
from services.runtime.service import load_user_service
from tests.docs.readme import blocks, section
from tests.harness.command_line import CommandLine

PROGRAM = """
from typing import Annotated
from msgspec import Meta
from services.runtime import Parameters, Service, main

class Mine(Parameters):
    speed: Annotated[float, Meta(ge=0, le=1)] = 0.5

def run(ctx):
    for _ in ctx.ticks():
        pass

if __name__ == "__main__":
    main(Service(name="mine", about="Mine.", run=run, rate=25, parameters=Mine))
"""
FLEET = """
name = "own"
[run]
mode = "lockstep"
ends = "duration"
duration = 16
[[robot]]
name = "a"
model = "burger"
services = [{{ kind = "controllers/{file}"{more} }}]
"""


def fleet(folder: Path, program: str, more: str = "") -> Path:
    """Write a fleet file beside a folder with the program; return its path."""
    (folder / "controllers").mkdir()
    (folder / "controllers" / "mine.py").write_text(program)
    path = folder / "own.toml"
    path.write_text(FLEET.format(file="mine.py", more=more))
    return path


TEXTUAL_HINTS = """
from __future__ import annotations
from typing import Annotated, Literal
from msgspec import Meta, Struct
from services.runtime import Parameters, Service, main, param

Law = Literal["pd", "pid"]

class Base(Parameters):
    gain: Annotated[float, Meta(ge=0)] = 1.0

class Mine(Base):
    mode: Literal["a", "b"] = param("a")
    law: Law = "pd"
    table: Table | None = None
    class Inner(Struct, frozen=True):
        side: Literal["left", "right"] = "left"
    inner: Inner = Inner()

class Table(Struct, frozen=True):
    law: Law

class Unused(Struct):
    what: Unknown

def run(ctx):
    pass

main(Service(name="mine", about="Mine.", run=run, rate=25, parameters=Mine))
"""


def test_type_hints_that_are_texts_are_those_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(TEXTUAL_HINTS)
    record = load_user_service(str(tmp_path / "mine.py")).parameters
    described = {each.name: each.choices for each in describe_parameters(record)}
    assert described["mode"] == ("a", "b")
    assert described["table.law"] == described["law"] == ("pd", "pid")
    assert described["inner.side"] == ("left", "right")
    values = {"mode": "b", "gain": 2, "table": {"law": "pid"}, "inner": {"side": "right"}}
    made = build(record, values)
    assert {name: flatten(made)[name] for name in ("mode", "gain", "table.law", "inner.side")} == {
        "mode": "b",
        "gain": 2.0,
        "table.law": "pid",
        "inner.side": "right",
    }
    with pytest.raises(BadInput, match="expected one of a, b"):
        build(record, {"mode": "c"})


def test_its_declaration_is_read_and_it_steps_with_the_simulation(tmp_path: Path) -> None:
    read = read_fleet(fleet(tmp_path, PROGRAM, ", parameters = { speed = 0.25 }"))
    (mine,) = (each for each in plan_processes(read, RunOptions(folder=tmp_path)) if each.name == "a/mine")
    assert mine.argv[1:6] == ("-P", "-m", "deploy", "run", str(tmp_path / "controllers" / "mine.py"))
    assert "--lockstep" in mine.argv
    assert "speed=0.25" in mine.argv
    assert mine.awaited


def test_its_parameters_are_checked_by_its_own_record(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"own\.toml:\d+: parameter speed = 3"):
        read_fleet(fleet(tmp_path, PROGRAM, ", parameters = { speed = 3 }"))


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("x = 1\n", "declares no service: it never calls main"),
        ("x = 1\nimport nowhere_at_all\n", r"mine\.py:2: it fails to load: ModuleNotFoundError"),
        ("x = 1\ny = (\n", r"mine\.py:2: it fails to load: SyntaxError"),
        ("import sys\nsys.exit(3)\n", r"mine\.py:2: it fails to load: SystemExit: 3"),
    ],
)
def test_what_is_wrong_with_it_is_told_with_both_places(tmp_path: Path, program: str, said: str) -> None:
    with pytest.raises(BadInput, match=rf"own\.toml:\d+: .*{said}"):
        read_fleet(fleet(tmp_path, program))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(FLEET.format(file="gone.py", more=""))
    with pytest.raises(BadInput, match=r"own\.toml:\d+: there is no file .*controllers/gone\.py"):
        read_fleet(path)


def test_the_path_of_imports_is_as_before(tmp_path: Path) -> None:
    import sys

    before = list(sys.path)
    (tmp_path / "beside.py").write_text("VALUE = 25\n")
    (tmp_path / "mine.py").write_text(PROGRAM.replace("rate=25", "rate=__import__('beside').VALUE"))
    assert load_user_service(str(tmp_path / "mine.py")).rate == 25
    assert sys.path == before


def test_the_controller_of_the_readme_drives_in_lockstep_and_repeats_bit_for_bit(tmp_path: Path) -> None:
    (program,) = blocks("python", section("A controller of your own"))
    path, terminal = fleet(tmp_path, program), CommandLine(tmp_path)

    def drive(name: str) -> dict[str, Any]:
        ended = terminal.run_fleet(path, tmp_path / name, "--json")
        assert ended.status == 0, ended.err
        report: dict[str, Any] = json.loads(ended.out)
        return report

    first, second = drive("first"), drive("second")
    assert first["robots"]["a"]["path_length_m"] == pytest.approx(2**0.5, abs=0.1)
    assert first["run"]["messages_lost"] == 0
    assert first["run"]["trajectory_hash"] == second["run"]["trajectory_hash"]
