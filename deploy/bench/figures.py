"""The figures of a benchmark, including those measured by tests marked ``bench``."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from services.runtime.process import ROOT


@dataclass(frozen=True)
class Figure:
    """A measured figure: its name in ``--json``, unit, text, the value of each round, and its bound."""

    name: str
    unit: str
    about: str
    rounds: tuple[float, ...]
    at_most: float | None = None
    at_least: float | None = None

    @property
    def median(self) -> float:
        """The median over the rounds."""
        return statistics.median(self.rounds)

    @property
    def bound(self) -> str:
        """The bound as shown."""
        if self.at_most is not None:
            return f"at most {self.at_most:g}"
        return f"at least {self.at_least:g}" if self.at_least is not None else ""

    @property
    def ok(self) -> bool:
        """Whether the median satisfies the bound."""
        return (self.at_most is None or self.median <= self.at_most) and (
            self.at_least is None or self.median >= self.at_least
        )


def ratios(ours: list[float], floor: list[float]) -> tuple[float, ...]:
    """Return ours over the baseline, round by round: both ran one after the other, under the same load."""
    return tuple(a / b for a, b in zip(ours, floor, strict=True))


FIGURE_PROPERTY = "figure"
"""Name of the property of a test result that holds a figure as JSON."""


def run_bench_tests(folder: Path, say: Callable[[str], None]) -> tuple[list[Figure], bool]:
    """Run the tests marked ``bench`` one by one; return their figures, and whether all passed."""
    say("tests that measure: help, panel, page, supervisor")
    results = folder / "results.xml"
    command = [sys.executable, "-P", "-m", "pytest", "-n", "0", "-m", "bench"]
    command += [f"--junitxml={results}", "-o", "junit_family=xunit1"]
    ran = subprocess.run(command, cwd=ROOT, stdout=sys.stderr, stderr=sys.stderr, check=False)
    return (read_figures(results) if results.exists() else []), ran.returncode == 0


def read_figures(results: Path) -> list[Figure]:
    """Return the figures in a JUnit result file of pytest."""
    found = ElementTree.parse(results).iter("property")
    values = [json.loads(each.attrib["value"]) for each in found if each.get("name") == FIGURE_PROPERTY]
    return [Figure(**{**each, "rounds": tuple(each["rounds"])}) for each in values]
