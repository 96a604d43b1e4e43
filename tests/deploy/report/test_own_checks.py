"""Checks that services publish themselves: in the report, its table and the exit status of a real run."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from deploy.report.checks import service_checks
from messages.base import decoder, encode
from messages.elea import MOST_CHECKS, Check, Checks
from services.runtime.context import ServiceChecks
from services.runtime.errors import BadInput
from services.runtime.process import ROOT
from tests.deploy.test_run import FleetCommandLine
from tests.harness.cases import case

STUDENT = """
from messages.topics import ODOM
from services.runtime import Service, main


def run(ctx):
    ctx.check("never_measured", None, min=0)
    try:
        for _ in ctx.ticks():
            ctx.check("at_the_end", True)
    finally:
        ctx.check("at_the_end", False, reason="it was told at the end")


main(Service(name="student", about="States checks.", run=run, rate=5))
"""


def example() -> str:
    """The example service of the page on grading."""
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "deploy/report/README.md").read_text(), re.DOTALL)
    return str(code)


def test_checks_of_services_count_in_every_mode(tmp_path: Path) -> None:
    """The modes run in parallel."""
    with ThreadPoolExecutor() as pool:
        for mode, done in [(each, pool.submit(_run_checks, tmp_path / each, each)) for each in ("lockstep", "real")]:
            with case(mode):
                done.result()


def _run_checks(tmp_path: Path, mode: str) -> None:
    tmp_path.mkdir()
    terminal = FleetCommandLine(tmp_path)
    (tmp_path / "judge.py").write_text(example())
    (tmp_path / "student.py").write_text(STUDENT)
    fleet = Path(terminal.fleet(mode, "goals", "[0.3, 0]"))
    text, own = fleet.read_text(), '{ kind = "judge.py" }'
    assert "goals = [[0.3, 0]] } }]" in text
    arguments = ("up", str(fleet), "--report", str(terminal.results), "--no-view", "--no-picture", "--no-saved")
    # In real time, a judge that gets no processor may not see the end.
    farthest = r"0\.[23]\d*" if mode == "lockstep" else r"-?[\d.e-]+"
    holds = rf"holds: /r/judge.farthest_m is {farthest}, should be at most 1: the wall is at x = 1 m\n"
    if mode == "lockstep":
        fleet.write_text(text.replace("[[0.3, 0]] } }]", f"[[0.3, 0]] }} }}, {own}]"))
        out = terminal.run(*arguments)
        assert terminal.report()["ok"] is True
        assert re.search(holds, out)

    fleet.write_text(text.replace("[[0.3, 0]] } }]", f'[[0.3, 0]] }} }}, {own}, {{ kind = "student.py" }}]'))
    out = terminal.run(*arguments, status=1)
    report = terminal.report()
    told = {each["name"]: each for each in report["checks"] if each["name"].startswith("/")}
    assert told.keys() == {"/r/judge.farthest_m", "/r/student.never_measured", "/r/student.at_the_end"}
    assert {name: each["ok"] for name, each in told.items() if not each["ok"]} == {
        "/r/student.never_measured": False,
        "/r/student.at_the_end": False,
    }, (out, [each.read_text() for each in terminal.results.glob("logs/*.log")])
    assert report["ok"] is False
    assert re.search(holds, out)
    assert "missed: /r/student.at_the_end is 0, should be at least 1: it was told at the end\n" in out
    assert "missed: /r/student.never_measured is not measured, should be at least 0\n" in out


def test_numbers_of_numpy_count_as_those_of_python() -> None:
    own = ServiceChecks()
    stated = own.state("a", np.bool_(True), None, None, "")  # type: ignore[arg-type]
    assert stated == (Check(name="a", value=1.0, min=1.0),)
    own.state("b", np.float32(1.5), np.int64(1), np.float64(2.0), "")  # type: ignore[arg-type]
    assert own.holds("a")
    assert own.holds("b")
    for wrong in ("x", np.zeros(2), 10**400):
        with pytest.raises(BadInput, match="the check 'c' cannot be stated"):
            own.state("c", wrong, 0.0, 1.0, "")  # type: ignore[arg-type]


def test_statements_are_bounded_and_the_last_counts() -> None:
    own = ServiceChecks()
    assert own.state("a", 1.0, None, 2.0, "") is not None
    assert own.state("a", 1.0, None, 2.0, "") is None
    assert own.holds("a")
    for value in (3.0, None, float("nan"), float("inf")):
        own.state("a", value, None, 2.0, "")
        assert not own.holds("a")
    own.state("b", True, None, None, "")
    assert own.holds("b")
    for name, least, reason, said in (
        ("a.b", 1.0, "", "name"),
        ("x" * 65, 1.0, "", "name"),
        ("c", None, "", "needs a bound"),
        ("c", float("nan"), "", "min"),
        ("c", 1.0, "x" * 201, "reason"),
    ):
        with pytest.raises(BadInput, match=said):
            own.state(name, 1.0, least, None, reason)
    stated: tuple[Check, ...] | None = ()
    for number in range(MOST_CHECKS - 2):
        stated = own.state(f"n{number}", 1e12, -1e12, 1e12, "ü" * 200)
    with pytest.raises(BadInput, match="one too many"):
        own.state("one_more", 1.0, 0.0, None, "")
    assert stated is not None
    assert len(stated) == MOST_CHECKS
    whole = Checks(node="/" + "n" * 254, checks=stated)
    assert decoder(Checks)(encode(whole)) == whole
    assert len(encode(whole)) < 1 << 16
    names = [each.name for each in service_checks({"/b": stated[1:2], "/a": stated[:1]})]
    assert names == ["/a.a", "/b.b"]
