"""The command line accepts every ``./elea`` line in the documents."""

from __future__ import annotations

import re
import shlex

import click

from deploy.commands.cli import COMMANDS, elea
from deploy.commands.lazy_group import LazyGroup
from deploy.fleet_file import fleet_names
from services.catalog import service_kinds
from services.runtime.container_main import NAME as CONTAINER
from services.runtime.process import ROOT
from tests.harness.cases import case
from tests.harness.project_files import project_files

LINE = re.compile(r"\./elea ([^`\n#|)]+)")
OF_SERVICES = {"--namespace", "--name", "--remap", "--param", "--connect", "--domain", "--topology", "--lockstep"}
OF_SERVICES |= {"--fleet-param", "--await-params", "--log-level", "--print-config", "--help", "--node"}


def lines() -> list[tuple[str, str]]:
    """Return every command with its document."""
    found = []
    for path in project_files(".md"):
        for command in LINE.findall(path.read_text()):
            found.append((str(path.relative_to(ROOT)), command.strip().rstrip(".,:;)")))
    return found


def options(verb: str, words: list[str]) -> set[str]:
    """Return the options of a command, or of the subcommand that the next word names."""
    command = elea.get_command(click.Context(elea), verb)
    assert isinstance(command, click.Command)
    if isinstance(command, LazyGroup) and words:
        assert words[0] in command.table, f"{verb} has no {words[0]}"
        inner = command.get_command(click.Context(command), words[0])
        assert inner is not None
        command = inner
    own = {option for each in command.params for option in (*each.opts, *each.secondary_opts)}
    return own | {"--help"} | (OF_SERVICES if verb == "run" else set())


def test_every_command_exists() -> None:
    for document, line in lines():
        with case(document, line):
            _check_command(line)


def _check_command(line: str) -> None:
    verb, *words = shlex.split(line)
    if verb == "--help":
        return
    assert verb in COMMANDS
    if verb in ("test", "python"):
        return  # the arguments are pytest's, or Python's
    assert {word for word in words if word.startswith("-")} <= options(verb, words)
    target = words[0] if words and not words[0].startswith("-") else ""
    known = {"up": fleet_names(), "run": (*service_kinds(), CONTAINER)}.get(verb)
    if known and target and not target.isupper() and not target.endswith((".toml", ".py")):
        assert target in known


def test_the_two_commands_are_there() -> None:
    assert {"up", "test"} <= {line for document, line in lines() if document == "README.md"}
