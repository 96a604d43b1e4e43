"""``elea diff``: where two runs differ."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.options import json_option

if TYPE_CHECKING:
    from deploy.report.compare import RunComparison


@click.command("diff")
@click.argument("left", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("right", metavar="RUN", type=click.Path(path_type=Path))
@json_option
def command(left: Path, right: Path, as_json: bool) -> None:
    """Show the first tick at which two runs differ: the robot by their trajectories, the topic and field by their bags.

    RUN is the folder of a run, or a bag. Bags are compared where both runs were recorded, as with ./elea up --record;
    what depends on the wall clock is left out. The status is 0 when the runs are the same, 1 when they differ, 2 for
    bad input.
    """
    from deploy.live.output import write_json, write_text
    from deploy.report.compare import compare_runs
    from deploy.run_folder import BAG_FOLDER

    found = compare_runs(left, right, BAG_FOLDER)
    if as_json:
        write_json(found)
    else:
        write_text("".join(f"{line}\n" for line in describe(found)))
    if not found.same:
        sys.exit(1)


def describe(found: RunComparison) -> list[str]:
    """Return the lines of output for people."""
    from deploy.report.compare import tick_of

    lines = [f"{'the runs are the same' if found.same else 'the runs differ'}: {found.left}, {found.right}"]
    if found.hashes is not None:
        one, other = found.hashes
        lines.append(f"trajectory hash {one}" if one == other else f"trajectory hashes {one[:12]}… and {other[:12]}…")
    if (moved := found.trajectory) is not None:
        at = f"t = {moved.time_s:.9g} s (tick {tick_of(moved.time_s)})"
        if moved.column:
            lines.append(f"{moved.robot} first differs at {at}: {moved.column} {moved.left} and {moved.right}")
        else:
            lines.append(f"{moved.robot} is the same up to {at}, from where only {_side(found, moved.left)} continues")
    if found.messages is not None and (sent := found.messages.difference) is not None:
        at = f"t = {sent.time_s:.9g} s (tick {tick_of(sent.time_s)})"
        what = f"{sent.topic} first differs at {at}, message {sent.number}"
        if sent.field:
            lines.append(f"{what}: {sent.field} is {_shown(sent.left)} and {_shown(sent.right)}")
        else:
            lines.append(f"{what}: only {_side(found, sent.left)} has it")
        if sent.also:
            lines.append(f"at the same time: {', '.join(sent.also)}")
    elif found.messages is not None:
        lines.append(f"all {found.messages.messages} messages of {found.messages.topics} topics are the same")
    return [*lines, *(f"note: {each}" for each in found.notes)]


def _side(found: RunComparison, left: Any) -> str:
    """Return the path of the run that has what the other lacks."""
    return found.left if left is not None else found.right


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 200 else f"{text[:200]}…"
