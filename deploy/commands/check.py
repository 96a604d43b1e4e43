"""``elea check``: what a developer runs before each commit, and the Git hook that does it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import click

from services.runtime.errors import BadInput
from services.runtime.process import ROOT

LINT_STEPS = {
    "format": ("-m", "ruff", "format", "--check", "--quiet", "."),
    "style": ("-m", "ruff", "check", "--quiet", "."),
    "types": ("-m", "mypy", "--no-error-summary"),
    "imports": ("-c", "from importlinter.cli import lint_imports_command as lint; lint()", "--no-logo"),
}
"""Arguments of Python for each step; tests/architecture runs the same ones."""

_HOOK = """#!/bin/sh
# Installed by ./elea check --install-hook; git commit --no-verify goes without it.
unset $(git rev-parse --local-env-vars)
exec ./elea check
"""


@click.command("check")
@click.option("--install-hook", is_flag=True, help="Let Git run it before each commit, and check nothing now.")
def command(install_hook: bool) -> None:
    """Check format, style, types and import contracts, and run the quick tests: those without processes.

    It takes less than a minute on two cores. The exit status is 1 when a step fails; all of them run.
    """
    if install_hook:
        click.echo(f"installed {install_pre_commit_hook(ROOT)}")
        return
    from deploy.commands.diagnostics import parallel_arguments

    workers = parallel_arguments((), len(os.sched_getaffinity(0)))
    steps = {**LINT_STEPS, "quick tests": ("-m", "pytest", *workers, "-m", "quick", "--no-header")}
    failed = [name for name, arguments in steps.items() if not _passes(name, arguments)]
    if failed:
        click.echo(f"failed: {', '.join(failed)}", err=True)
    raise SystemExit(1 if failed else 0)


def _passes(name: str, arguments: tuple[str, ...]) -> bool:
    """Run a step, which prints its complaints, and show how long it took."""
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
    if ran.returncode and ran.stdout:
        click.echo(ran.stdout.strip())
    click.echo(f"{name:<12} {'failed' if ran.returncode else 'ok':<7} {time.monotonic() - began:5.1f} s")
    return ran.returncode == 0


def install_pre_commit_hook(root: Path) -> Path:
    """Install the hook in the Git repository of ``root``; raises BadInput outside one, or if there is another hook."""
    found = subprocess.run(
        ["git", "rev-parse", "--git-path", "hooks/pre-commit"], cwd=root, capture_output=True, text=True, check=False
    )
    if found.returncode:
        raise BadInput(f"{root} is no Git repository: {found.stderr.strip()}")
    hook = root / found.stdout.strip()
    if hook.exists() and hook.read_text() != _HOOK:
        raise BadInput(f"{hook} exists already: add a line ./elea check to it, or remove it first")
    hook.parent.mkdir(parents=True, exist_ok=True)
    hook.write_text(_HOOK)
    hook.chmod(0o755)
    return hook
