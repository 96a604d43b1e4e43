"""``elea test``: the tests, by pytest, with its exit status; whole folders several at a time."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from services.runtime.process import ROOT

_PER_PROCESSOR, _MOST = 2, 8
"""Tests at a time: they wait for processes and deadlines for three quarters of their time."""

_ONE_BY_ONE = ("-n", "--numprocesses", "--dist", "--pdb", "--trace", "-s", "--capture", "--co", "--collect-only")
"""Options of pytest that choose how many there are at a time, or that show what only one process can show."""


@click.command("test", context_settings={"ignore_unknown_options": True, "help_option_names": []})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(arguments: tuple[str, ...]) -> None:
    """Run the tests of the project; the arguments are pytest's, with paths from the project's folder.

    Several files run at a time, unless single ones are named or -n says how many: -n 0 runs one test after the other.
    """
    os.chdir(ROOT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    beside = at_a_time(arguments, len(os.sched_getaffinity(0)))
    os.execve(sys.executable, [sys.executable, "-P", "-m", "pytest", *beside, *arguments], environment)


def at_a_time(arguments: Sequence[str], processors: int) -> list[str]:
    """What pytest is told in addition, for a machine with so many processors; nothing where tests run one by one.

    The tests of a file stay together, as they share what they start.
    """
    chosen = any(each.startswith("-n") or each.partition("=")[0] in _ONE_BY_ONE for each in arguments)
    named = [Path(each.partition("::")[0]) for each in arguments if not each.startswith("-")]
    files = [each for each in named if each.suffix == ".py"]
    if chosen or "no:xdist" in " ".join(arguments) or (files and not any(each.is_dir() for each in named)):
        return []
    return ["-n", str(min(_MOST, _PER_PROCESSOR * processors)), "--dist", "loadfile", "--no-loadscope-reorder"]
