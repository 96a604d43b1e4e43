"""A fleet of a hundred robots on the terminal: one status line while it starts, and lists filtered by pattern."""

from __future__ import annotations

from deploy.commands.fleet import _sum_row
from deploy.commands.options import fits
from deploy.progress import FEW_PROCESSES, waiting_line

NAMES = [f"tb3_{number}/waypoint" for number in range(100)]


def test_what_a_fleet_waits_for_is_one_short_line() -> None:
    assert waiting_line(["sim", "router"], FEW_PROCESSES) == "waiting for sim, router"
    line = waiting_line(NAMES[30:], 105)
    assert line.startswith("35 of 105 processes ready, waiting for tb3_30/waypoint, tb3_31/waypoint, ")
    assert line.endswith(" and 65 more")
    assert len(line) < 160
    assert waiting_line(NAMES[98:], 105).endswith("waiting for tb3_98/waypoint, tb3_99/waypoint")


def test_a_filter_is_a_text_or_a_pattern() -> None:
    for pattern, count in (
        ("", 100),
        ("tb3_1", 11),
        ("tb3_1?/*", 10),
        ("/tb3_4/*", 1),
        ("*/grader", 0),
        ("tb3_[12]/*", 2),
    ):
        assert sum(fits(f"/{name}", pattern) for name in NAMES) == count, pattern
        assert sum(fits(name, pattern.lstrip("/")) for name in NAMES) == count, pattern


def test_processes_are_summed() -> None:
    listed = [
        {"name": "sim", "state": "ready", "memory_mib": 100.0, "cpu_percent": 90.0, "restarts": 0},
        {"name": "waypoint", "state": "ready", "memory_mib": 20.5, "cpu_percent": 1.5, "restarts": 2},
        {"name": "grader", "state": "failed", "memory_mib": None, "cpu_percent": None, "restarts": 0},
    ]
    assert _sum_row(listed) == ("3 processes", "2 ready, 1 failed", "", "2", "120.5", "91.5", "")
