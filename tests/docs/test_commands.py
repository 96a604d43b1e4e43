"""Every ``./elea`` line in the documents is one that the command line takes."""

from __future__ import annotations

import importlib
import re
import shlex

import click
import pytest

from deploy.catalogue import kinds
from deploy.commands.cli import VERBS
from deploy.commands.table import Verbs
from deploy.fleet_file import fleet_names
from services.runtime.process import ROOT
from tests.tree import files

LINE = re.compile(r"\./elea ([^`\n#|]+)")
OF_SERVICES = {"--namespace", "--name", "--remap", "--param", "--connect", "--domain", "--topology", "--lockstep"}
OF_SERVICES |= {"--fleet-param", "--await-params", "--log-level", "--print-config", "--help"}


def lines() -> list[tuple[str, str]]:
    """Every command with the document that it stands in."""
    found = []
    for path in files(".md"):
        for command in LINE.findall(path.read_text()):
            found.append((str(path.relative_to(ROOT)), command.strip().rstrip(".,:;)")))
    return found


def options(verb: str, words: list[str]) -> set[str]:
    """The options of a verb, or of the verb below it that the next word names."""
    command = importlib.import_module(f"deploy.commands.{VERBS[verb].module}").command
    assert isinstance(command, click.Command)
    if isinstance(command, Verbs) and words:
        assert words[0] in command.table, f"{verb} has no {words[0]}"
        inner = command.get_command(click.Context(command), words[0])
        assert inner is not None
        command = inner
    own = {option for each in command.params for option in (*each.opts, *each.secondary_opts)}
    return own | {"--help"} | (OF_SERVICES if verb == "run" else set())


@pytest.mark.parametrize(("document", "line"), lines())
def test_a_command_exists(document: str, line: str) -> None:
    verb, *words = shlex.split(line)
    if verb == "--help":
        return
    assert verb in VERBS
    if verb == "test":
        return  # the words are pytest's
    assert {word for word in words if word.startswith("-")} <= options(verb, words)
    target = words[0] if words and not words[0].startswith("-") else ""
    known = {"up": fleet_names(), "run": kinds()}.get(verb)
    if known and target and not target.isupper() and not target.endswith((".toml", ".py")):
        assert target in known


def test_the_two_commands_are_there() -> None:
    assert {"up", "test"} <= {line for document, line in lines() if document == "README.md"}
