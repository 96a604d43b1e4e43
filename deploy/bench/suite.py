"""Figures that tests measure: those marked ``bench``, which need a browser or the harness of the tests."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from deploy.bench.figures import Figure
from services.runtime.process import ROOT

FIGURE_PROPERTY = "figure"
"""Name of the property of a test's result that holds a figure as JSON."""


def run_bench_tests(folder: Path, say: Callable[[str], None]) -> tuple[list[Figure], bool]:
    """Run the tests marked ``bench``, one after the other; their figures, and whether all passed."""
    say("tests that measure: help, panel, page, supervisor")
    results = folder / "results.xml"
    command = [sys.executable, "-P", "-m", "pytest", "-n", "0", "-m", "bench"]
    command += [f"--junitxml={results}", "-o", "junit_family=xunit1"]
    ran = subprocess.run(command, cwd=ROOT, stdout=sys.stderr, stderr=sys.stderr, check=False)
    return (read_figures(results) if results.exists() else []), ran.returncode == 0


def read_figures(results: Path) -> list[Figure]:
    """The figures in a file of results that pytest wrote in the format of JUnit."""
    found = ElementTree.parse(results).iter("property")
    values = [json.loads(each.attrib["value"]) for each in found if each.get("name") == FIGURE_PROPERTY]
    return [Figure(**{**each, "rounds": tuple(each["rounds"])}) for each in values]
