"""``elea check``: the checks before each commit, and the Git hook that runs them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import click

from services.runtime.errors import BadInput
from services.runtime.process import ROOT

LINT_STEPS = {
    "format": ("-m", "ruff", "format", "--check", "--quiet", "."),
    "style": ("-m", "ruff", "check", "--quiet", "."),
    "types": ("-m", "mypy", "--no-error-summary"),
    "ros1 types": ("-m", "mypy", "--no-error-summary", "--config-file", "services/ros1/mypy.ini"),
    "imports": ("-c", "from importlinter.cli import lint_imports_command as lint; lint()", "--no-logo"),
}
"""Arguments of Python for each step; tests/architecture runs the same steps."""
BESIDE_TESTS = ("types", "ros1 types", "imports")
"""Single-process steps of several seconds: they run alongside the tests, which leave a core idle at times."""
NO_QUICK_TESTS = ("tests/system", "tests/faults", "tests/ros1")
"""Folders with tests that start fleets: importing them takes time, and none of them is quick."""

_HOOK = """#!/bin/sh
# Installed by ./elea check --install-hook; git commit --no-verify goes without it.
unset $(git rev-parse --local-env-vars)
exec ./elea check
"""


@click.command("check")
@click.option(
    "--install-hook",
    is_flag=True,
    help="Install a Git hook that runs this command before each commit; check nothing now.",
)
def command(install_hook: bool) -> None:
    """Check format, style, types and import contracts, and run the quick tests: those without processes.

    It takes less than a minute on two cores. The exit status is 1 when a step fails; all of them run.
    """
    if install_hook:
        click.echo(f"installed {install_pre_commit_hook(ROOT)}")
        return
    from deploy.commands.diagnostics import parallel_arguments

    workers = parallel_arguments((), len(os.sched_getaffinity(0)))
    ignored = [f"--ignore={each}" for each in NO_QUICK_TESTS]
    failed = [name for name in LINT_STEPS if name not in BESIDE_TESTS and not _passes(_run(name, LINT_STEPS[name]))]
    with ThreadPoolExecutor(1) as beside:
        waiting = [beside.submit(_run, name, LINT_STEPS[name]) for name in BESIDE_TESTS]
        tests = _run("quick tests", ("-m", "pytest", *workers, *ignored, "-m", "quick", "--no-header"))
        failed += [each.name for each in (*(step.result() for step in waiting), tests) if not _passes(each)]
    if failed:
        click.echo(f"failed: {', '.join(failed)}", err=True)
    raise SystemExit(1 if failed else 0)


class _Step(NamedTuple):
    """The result of a step: whether it failed, its output, and its wall time [s]."""

    name: str
    failed: bool
    output: str
    seconds: float


def _run(name: str, arguments: tuple[str, ...]) -> _Step:
    """Run a step; tests print on the terminal as they run."""
    began = time.monotonic()
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    ran = subprocess.run(
        [sys.executable, "-P", *arguments],
        cwd=ROOT,
        env=environment,
        check=False,
        stdout=None if "pytest" in arguments else subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    return _Step(name, ran.returncode != 0, (ran.stdout or "").strip(), time.monotonic() - began)


def _passes(step: _Step) -> bool:
    """Print the result of a step; return whether it passed."""
    if step.failed and step.output:
        click.echo(step.output)
    click.echo(f"{step.name:<12} {'failed' if step.failed else 'ok':<7} {step.seconds:5.1f} s")
    return not step.failed


def install_pre_commit_hook(root: Path) -> Path:
    """Install the hook in the Git repository of ``root``; raises BadInput outside one, or if there is another hook."""
    found = subprocess.run(
        ["git", "rev-parse", "--git-path", "hooks/pre-commit"], cwd=root, capture_output=True, text=True, check=False
    )
    if found.returncode:
        raise BadInput(f"{root} is not a Git repository: {found.stderr.strip()}")
    hook = root / found.stdout.strip()
    if hook.exists() and hook.read_text() != _HOOK:
        raise BadInput(f"{hook} exists already: add the line ./elea check to it, or remove it first")
    hook.parent.mkdir(parents=True, exist_ok=True)
    hook.write_text(_HOOK)
    hook.chmod(0o755)
    return hook
