"""The scripts that switch completion on in zsh and fish, for a program that lies in no folder of the PATH.

Click's own scripts ask ``elea``, wherever the shell finds that; these ask the ``./elea`` of this project by its place.
Click's script for bash asks the command as it was typed, and serves as it is.
"""

from __future__ import annotations

import shlex

from click.shell_completion import FishComplete, ZshComplete, add_completion_class

from services.runtime.process import ROOT

_PROGRAM = shlex.quote(str(ROOT / "elea"))
_IN_PATH = "    (( ! $+commands[%(prog_name)s] )) && return 1\n"


class PlacedZsh(ZshComplete):
    """Completion in zsh by the script's place."""

    source_template = ZshComplete.source_template.replace(_IN_PATH, "").replace(
        "_complete %(prog_name)s", f"_complete {_PROGRAM.replace('%', '%%')}"
    )


class PlacedFish(FishComplete):
    """Completion in fish by the script's place."""

    source_template = FishComplete.source_template.replace(
        "(commandline -t) %(prog_name)s", f"(commandline -t) {_PROGRAM.replace('%', '%%')}"
    )


def register() -> None:
    """Let click take these scripts."""
    add_completion_class(PlacedZsh)
    add_completion_class(PlacedFish)
