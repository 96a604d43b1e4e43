"""The middleware against raw floors, measured in turn in the same run: only ratios hold on a machine that is shared."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from deploy.bench.figures import Figure


def bench(rounds: int, as_json: bool) -> int:
    """Measure everything and show it; status 1 when a bound is missed or a test that measures fails."""
    from deploy.bench.figures import run_bench_tests

    figures = measure(rounds)
    with tempfile.TemporaryDirectory() as folder:
        more, passed = run_bench_tests(Path(folder), _say)
    return max(report(figures + more, as_json), 0 if passed else 1)


def measure(rounds: int) -> list[Figure]:
    """Every figure that sets the middleware against a raw floor, and the cost of an idle fleet."""
    from deploy.bench import fleet, lockstep, wire
    from services.runtime.ports import free_port

    with tempfile.TemporaryDirectory() as folder:
        figures = wire.run_wire(rounds, Path(folder), _say)
    figures += wire.measure_codec(rounds)
    figures += lockstep.measure_lockstep(rounds, free_port(), _say)
    figures += fleet.measure_idle(1, free_port(), _say)
    return figures


def report(figures: list[Figure], as_json: bool) -> int:
    """Print the figures; status 1 when one misses its bound."""
    if as_json:
        sys.stdout.write(json.dumps({each.name: _row(each) for each in figures}, indent=2) + "\n")
    else:
        _show(figures)
    return 0 if all(each.ok for each in figures) else 1


def _say(text: str) -> None:
    sys.stderr.write(f"bench: {text}\n")


def _row(figure: Figure) -> float:
    return round(figure.median, 4)


def _show(figures: list[Figure]) -> None:
    width = max(len(each.name) for each in figures)
    for each in figures:
        verdict = "" if not each.bound else f"{each.bound}: {'holds' if each.ok else 'MISSED'}"
        low, high = min(each.rounds), max(each.rounds)
        spread = f"[{low:.4g} .. {high:.4g}]" if len(each.rounds) > 1 else ""
        value = f"{each.median:.4g} {each.unit}".rstrip()
        sys.stdout.write(f"{each.name:<{width}}  {value:>12} {spread:<22} {verdict:<24} {each.about}\n")
