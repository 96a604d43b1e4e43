"""``elea rostest``: run the tests of a launch file of ROS 1, each in a fleet of its own."""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from deploy import INTERRUPTED
from deploy.fleet import MODES


@click.command("rostest")
@click.argument("words", nargs=-1, required=True, metavar="(PACKAGE FILE | PATH) [ARG:=VALUE]...")
@click.option("--mode", type=click.Choice(MODES), help="How time runs; real by default.")
@click.option("--xunit", metavar="DIR", default="", help="Folder for the results as JUnit XML.")
@click.option("--runs", metavar="DIR", default="", help="Parent folder of the run folders; runs by default.")
@click.option("--seed", type=int, metavar="N", help="Random seed of the sensor noise and of the programs.")
@click.option("--port", type=int, help="Port that identifies the fleets of the tests; not that of a running fleet.")
@click.option("--text", "-t", is_flag=True, hidden=True)
def command(words: tuple[str, ...], xunit: str, runs: str, text: bool, **options: Any) -> None:
    """Run the <test> tags of a launch file, with its nodes, one after the other.

    A test passes if its program succeeds before its time-limit, counted in simulation time. The exit status is 1 if a
    test failed.
    """
    from deploy.launch.fleet_of_launch import fleet_of_launch
    from deploy.launch.launch_file import read_launch
    from deploy.launch.open_launch import checked_fleet, find_launch, split_words
    from services.runtime.errors import BadInput

    names, arguments = split_words(words)
    path, packages = find_launch(names, Path.cwd())
    tests = read_launch(path, arguments, packages).tests
    if not tests:
        raise BadInput(f"{path} has no <test>")
    folder = Path(xunit).absolute() if xunit else None
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadInput(f"--xunit: the folder {folder} cannot be made: {error.strerror}") from None
    failed = []
    for test in tests:
        output = "" if folder is None else shlex.quote(f"--gtest_output=xml:{folder / f'{test.name}.xml'}")
        launch = read_launch(path, arguments, packages)
        made = fleet_of_launch(launch, packages, replace(test, args=f"{test.args} {output}".rstrip()))
        for note in made.notes:
            sys.stderr.write(f"{note}\n")
        failure = _run(checked_fleet(path, made), {**options, "factor": None, "duration": None}, runs)
        sys.stdout.write(f"[{test.package}/{test.test}] {'passed' if failure is None else f'FAILED: {failure}'}\n")
        failed += [test.test] if failure is not None else []
    sys.stdout.write(f"\nSUMMARY\n * RESULT: {'FAIL' if failed else 'SUCCESS'}\n")
    sys.stdout.write(
        f" * TESTS: {len(tests)}\n * FAILURES: {len(failed)}{f' ({chr(44).join(failed)})' if failed else ''}\n"
    )
    raise SystemExit(1 if failed else 0)


def _run(fleet: Any, options: dict[str, Any], runs: str) -> str | None:
    """Run the fleet of a test; return why it failed, None if it passed. An interrupt ends the command."""
    from deploy.commands.up import override_run
    from deploy.progress import open_display
    from deploy.run_fleet import run_fleet
    from deploy.run_folder import make_run_folder
    from deploy.service_parameters import RunOptions

    fleet = override_run(fleet, options)
    folder = make_run_folder(fleet.name, "", runs)
    with open_display() as shown:
        outcome = run_fleet(fleet, RunOptions(folder=folder, view=False, picture=False), shown).outcome
    match outcome.ended:
        case "finished":
            return None
        case "graded":
            return f"not finished within {fleet.run.duration:g} s; logs in {folder / 'logs'}"
        case "interrupted":
            raise SystemExit(INTERRUPTED)
        case _:
            return f"{outcome.reason}; logs in {folder / 'logs'}"
