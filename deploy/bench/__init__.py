"""Benchmarks of the middleware against raw baselines, in turn in the same run: on a shared machine only ratios hold."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Collection, Sequence
from pathlib import Path

from deploy.bench.figures import Figure

PARTS = ("wire", "lockstep", "idle", "ros1", "scale", "tests")
"""The parts of the benchmark: messages, ``lab`` in lockstep, an idle fleet, ROS 1 programs, ``swarm`` at several sizes,
and the measuring tests.
"""
DEFAULT_SIZES = (4, 16)
"""Numbers of robots of ``swarm`` in a full run; each larger size takes minutes."""


def bench(rounds: int, as_json: bool, only: Collection[str] = (), sizes: Sequence[int] = ()) -> int:
    """Measure and print the figures; return 1 if a bound is missed or a measuring test fails.

    Args:
        rounds: How often to measure each figure.
        as_json: Whether to print JSON.
        only: Parts of ``PARTS``; all if empty.
        sizes: Numbers of robots of ``swarm``; DEFAULT_SIZES if empty, or all sizes if ``scale`` is named.
    """
    from deploy.bench.figures import run_bench_tests

    figures, passed = measure(rounds, only, sizes), True
    if "tests" in (only or PARTS):
        with tempfile.TemporaryDirectory() as folder:
            more, passed = run_bench_tests(Path(folder), _print_progress)
        figures += more
    return max(report(figures, as_json), 0 if passed else 1)


def measure(rounds: int, only: Collection[str] = (), sizes: Sequence[int] = ()) -> list[Figure]:
    """Return every figure of the middleware relative to a raw baseline, and the cost of an idle fleet."""
    from deploy.bench import fleet, lockstep, ros1, scale, wire
    from services.runtime.ports import free_port

    parts, figures = only or PARTS, list[Figure]()
    if "wire" in parts:
        with tempfile.TemporaryDirectory() as folder:
            figures += wire.run_wire(rounds, Path(folder), _print_progress)
        figures += wire.measure_codec(rounds)
    if "lockstep" in parts:
        figures += lockstep.measure_lockstep(rounds, free_port(), _print_progress)
    if "idle" in parts:
        figures += fleet.measure_idle(1, free_port(), _print_progress)
    if "ros1" in parts:
        figures += ros1.measure_ros1(rounds, free_port(), _print_progress)
    if "scale" in parts:
        chosen = sizes or (scale.SIZES if "scale" in only else DEFAULT_SIZES)
        figures += scale.measure_scale(rounds if only else 1, chosen, free_port(), _print_progress)
    return figures


def report(figures: list[Figure], as_json: bool) -> int:
    """Print the figures; return 1 if one misses its bound."""
    if as_json:
        sys.stdout.write(json.dumps({each.name: _row(each) for each in figures}, indent=2) + "\n")
    else:
        _show(figures)
    return 0 if all(each.ok for each in figures) else 1


def _print_progress(text: str) -> None:
    sys.stderr.write(f"bench: {text}\n")


def _row(figure: Figure) -> float:
    return round(figure.median, 4)


def _show(figures: list[Figure]) -> None:
    width = max((len(each.name) for each in figures), default=0)
    for each in figures:
        verdict = "" if not each.bound else f"{each.bound}: {'holds' if each.ok else 'MISSED'}"
        low, high = min(each.rounds), max(each.rounds)
        spread = f"[{low:.4g} .. {high:.4g}]" if len(each.rounds) > 1 else ""
        value = f"{each.median:.4g} {each.unit}".rstrip()
        sys.stdout.write(f"{each.name:<{width}}  {value:>12} {spread:<22} {verdict:<24} {each.about}\n")
