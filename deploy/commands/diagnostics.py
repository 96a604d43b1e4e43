"""``elea doctor``, ``test`` and ``bench``."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from deploy.bench import PARTS
from deploy.commands.options import fleet_option, json_option
from services.runtime.process import ROOT


@click.command("doctor")
@click.option("--connect", metavar="ENDPOINT", default="", help="Router to join; the running fleet's by default.")
@click.option("--domain", default="", help="Domain of the fleet.")
@fleet_option
@json_option
def doctor_command(connect: str, domain: str, port: int | None, as_json: bool) -> None:
    """Check the machine, the installation and the running fleet for problems.

    Each check is ok, a warning or a failure, with its finding and a remedy. The exit status is 1 if a check fails.
    """
    from deploy.doctor.checks import print_findings, run_checks

    findings = run_checks(connect, domain, port)
    print_findings(findings, as_json)
    raise SystemExit(1 if any(each.state == "fail" for each in findings) else 0)


_MAX_WORKERS = 8
"""Maximum number of parallel tests, one per processor: many of them run a fleet of a dozen processes."""

_BACKGROUND = ("waiting1", "waiting2", "computing")
"""Identifiers of the additional processes that ``tests/scheduling.py`` knows."""

_SERIAL_OPTIONS = ("-n", "--numprocesses", "--dist", "--pdb", "--trace", "-s", "--capture", "--co", "--collect-only")
"""Pytest options that set the number of processes, or whose output needs a single process."""


@click.command("test", context_settings={"ignore_unknown_options": True})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def test_command(arguments: tuple[str, ...]) -> None:
    """Run all tests except the measurements, or the tests of your own file; arguments are passed to pytest.

    Paths are relative to the current folder, or else to the project. Test files run in parallel unless single files are
    named; -n sets the number of processes, -n 0 runs all in one. -m selects by markers: quick, slow, process, fleet,
    browser, bench. `./elea test -h` shows the options of pytest.
    """
    arguments = tuple(path_from(each, Path.cwd()) for each in arguments)
    os.chdir(ROOT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ours = not are_external(arguments)
    beside = parallel_arguments(arguments, len(os.sched_getaffinity(0)), background=ours)
    if ours and not any(each.startswith("-m") for each in arguments):
        beside += ["-m", "not bench"]
    os.execve(sys.executable, [sys.executable, "-P", "-m", "pytest", *beside, *arguments], environment)


def path_from(argument: str, folder: Path) -> str:
    """Make an argument that is an existing path relative to ``folder`` absolute, since the tests run in the project."""
    path, colons, test = argument.partition("::")
    is_path = not argument.startswith("-") and ("/" in path or path.endswith(".py"))
    return f"{folder / path}{colons}{test}" if is_path and (folder / path).exists() else argument


def are_external(arguments: Sequence[str]) -> bool:
    """Return whether all named tests lie outside this project, so that its markers do not apply."""
    named = [Path(each.partition("::")[0]).resolve() for each in arguments if not each.startswith("-")]
    there = [each for each in named if each.exists()]
    return bool(there) and not any(each == ROOT or each.is_relative_to(ROOT / "tests") for each in there)


def parallel_arguments(arguments: Sequence[str], processors: int, background: bool = False) -> list[str]:
    """Return pytest's additional arguments for a number of CPUs; none if the tests run one by one.

    The tests of a file stay together, since they share what they start. With ``background``, three processes more use
    the time in which the others wait (``tests/scheduling.py``).
    """
    chosen = any(each.startswith("-n") or each.partition("=")[0] in _SERIAL_OPTIONS for each in arguments)
    named = [Path(each.partition("::")[0]) for each in arguments if not each.startswith("-")]
    files = [each for each in named if each.suffix == ".py"]
    if chosen or "no:xdist" in " ".join(arguments) or (files and not any(each.is_dir() for each in named)):
        return []
    workers = ["--tx", f"{min(_MAX_WORKERS, processors)}*popen"]
    if background:
        workers += [word for each in _BACKGROUND for word in ("--tx", f"popen//id={each}")]
    return [*workers, "--dist", "loadfile", "--no-loadscope-reorder"]


@click.command("bench")
@click.option(
    "--rounds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Number of rounds; medians are shown."
)
@click.option(
    "--only", multiple=True, type=click.Choice(PARTS), help="Measure only this part; may be repeated. All by default."
)
@click.option(
    "--robots",
    type=click.IntRange(1, 1000),
    multiple=True,
    metavar="N",
    help="Number of robots for the part scale; may be repeated. By default 4 and 16, with --only scale also 64, 100.",
)
@json_option
def bench_command(rounds: int, as_json: bool, only: tuple[str, ...], robots: tuple[int, ...]) -> None:
    """Measure round trip, throughput, lockstep, scaling and start-up against raw Zenoh and raw physics, interleaved.

    Then run the tests that measure processor time (of --help, panel and supervisor) and the page's frame rate.
    """
    from deploy.bench import bench

    raise SystemExit(bench(rounds, as_json, only, robots))
