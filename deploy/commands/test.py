"""``elea test``: the tests, by pytest, with its exit status."""

from __future__ import annotations

import os
import sys

import click

from services.runtime.process import ROOT


@click.command("test", context_settings={"ignore_unknown_options": True, "help_option_names": []})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(arguments: tuple[str, ...]) -> None:
    """Run the tests of the project; the arguments are pytest's, with paths from the project's folder."""
    os.chdir(ROOT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    os.execve(sys.executable, [sys.executable, "-P", "-m", "pytest", *arguments], environment)
