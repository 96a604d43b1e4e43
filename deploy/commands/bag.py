"""``elea bag``: record, play, inspect and export bags."""

from __future__ import annotations

import json
import os
import re
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import TOPIC
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option, network_options
from deploy.live.message_format import escape_unprintable
from deploy.live.output import write_text
from services.runtime.errors import BadInput, EleaError
from services.runtime.network_address import NetworkAddress
from services.runtime.process import ROOT

if TYPE_CHECKING:
    from services.bag.info import BagInfo, TopicInfo

_UNITS = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9, "Ki": 2**10, "Mi": 2**20, "Gi": 2**30}


class IncompleteBag(EleaError):
    """A bag is incomplete, damaged, or could only be partly used."""


COMMANDS = {
    "record": LazyCommand("bag:record_command", "Record topics, or all of them, until Ctrl-C."),
    "play": LazyCommand("bag:play_command", "Play a bag back on simulated time."),
    "info": LazyCommand("bag:info_command", "Show what a bag holds."),
    "export": LazyCommand("bag:export_command", "Convert a bag to CSV or to a viewer recording, or repair it."),
}


@click.command(cls=LazyGroup, name="bag", table=COMMANDS)
def command() -> None:
    """Record, play, inspect and export bags: MCAP files in a rosbag2 folder, which ROS 2's own tools can read."""


@click.command("record")
@click.argument("topics", nargs=-1, type=TOPIC)
@click.option("-a", "--all", "everything", is_flag=True, help="Record all topics, including those that appear later.")
@click.option("-e", "--regex", default="", help="Record topics whose names match this regular expression.")
@click.option(
    "-x",
    "--exclude",
    default="",
    metavar="REGEX",
    help="Do not record topics whose names match this regular expression.",
)
@click.option("-o", "--output", default="", help="Folder of the bag; rosbag2_TIME by default.")
@click.option("-b", "--max-size", default="0", metavar="BYTES", help="Split files at this size, e.g. 100M or 1Gi.")
@click.option(
    "-d", "--max-duration", type=float, default=0.0, metavar="S", help="Split files after S seconds of wall time."
)
@network_options
def record_command(topics: tuple[str, ...], everything: bool, address: NetworkAddress, **given: Any) -> None:
    """Record TOPICS, or all with -a, until Ctrl-C.

    The exit status is 1 if not everything could be written; the bag is then readable up to that point.
    """
    if not topics and not everything and not given["regex"]:
        raise BadInput("nothing to record: name topics, or give --all or --regex")
    if everything and (topics or given["regex"]):
        raise BadInput("--all records every topic: leave out the names and --regex, or --all")
    output = given["output"] or f"rosbag2_{datetime.now():%Y_%m_%d-%H_%M_%S}"
    parameters = {
        "output": str(Path(output).absolute()),
        "topics": topics,
        "regex": given["regex"],
        "exclude": given["exclude"],
        "max_size": _parse_size(given["max_size"]),
        "max_duration": given["max_duration"],
    }
    _exec_service("recorder", parameters, address.arguments)


@click.command("play")
@click.argument("bag", type=click.Path(path_type=Path))
@click.option("-r", "--rate", type=float, help="Playback rate; 1 by default, 0 for as fast as possible.")
@click.option("-l", "--loop", is_flag=True, help="Start again at the end, in a new epoch.")
@click.option("--topics", multiple=True, metavar="TOPIC", help="Play only this topic; may be repeated.")
@click.option(
    "-x", "--exclude", default="", metavar="REGEX", help="Do not play topics whose names match this regular expression."
)
@click.option("--start", "--start-offset", type=float, default=0.0, metavar="S", help="Start S seconds into the bag.")
@click.option("--duration", "--playback-duration", type=float, default=0.0, metavar="S", help="Play only S seconds.")
@click.option("-m", "--remap", multiple=True, metavar="FROM:=TO", help="Publish under another name; may be repeated.")
@click.option(
    "--clock", type=float, default=0.0, metavar="HZ", help="Publish /clock at this rate instead of the recorded one."
)
@click.option(
    "--wait",
    "--wait-for-subscribers",
    type=float,
    default=0.0,
    metavar="S",
    help="Wait up to S seconds for subscribers.",
)
@click.option(
    "--lockstep", metavar="NODES", default="", help="Step these nodes with the bag, as their simulation, e.g. /a/b,/c."
)
@click.option("--latency", type=click.IntRange(0, 1), help="Lockstep latency in ticks; as recorded by default.")
@network_options
def play_command(bag: Path, lockstep: str, address: NetworkAddress, **given: Any) -> None:
    """Play BAG in simulation time: publish /clock, or follow a running simulation's.

    Heartbeats, process states and parameters are played only if their topics are named. With --lockstep, the named
    nodes receive each message at the tick at which it was recorded, however fast the machine is, so that their outputs
    repeat. The exit status is 1 if something could not be played.
    """
    from services.bag.reader import open_bag

    open_bag(bag)
    members = [each if each.startswith("/") else f"/{each}" for each in lockstep.split(",") if each]
    rate = given["rate"] if given["rate"] is not None else 0.0 if members else 1.0
    if given["latency"] is not None and not members:
        raise BadInput("--latency is for --lockstep: name the nodes that step with the bag, or leave it out")
    names = ("loop", "exclude", "start", "duration", "clock", "wait", "latency")
    parameters = {name: given[name] for name in names} | {
        "bag": str(bag.absolute()),
        "topics": given["topics"],
        "rate": rate,
        "members": members,
    }
    arguments = address.arguments
    for rule in given["remap"]:
        arguments += ["--remap", rule]
    if members:
        arguments += ["--name", "sim", "--lockstep"]
    _exec_service("player", parameters, arguments)


@click.command("info")
@click.argument("bag", type=click.Path(path_type=Path))
@json_option
def info_command(bag: Path, as_json: bool) -> None:
    """Show the contents of BAG. The exit status is 1 if it is incomplete or damaged."""
    import msgspec

    from services.bag.info import bag_info
    from services.bag.reader import open_bag

    found = bag_info(open_bag(bag))
    if as_json:
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(found), indent=2).decode() + "\n")
    else:
        print_info(found)
    if found.troubles:
        raise IncompleteBag("; ".join(found.troubles))


@click.command("export")
@click.argument("bag", type=click.Path(path_type=Path))
@click.option(
    "--to", "form", type=click.Choice(["csv", "rrd", "rosbag2"]), default="csv", help="Output format; csv by default."
)
@click.option("-o", "--output", default="", help="Output folder, or file for rrd; next to the bag by default.")
@click.option("--topics", multiple=True, metavar="TOPIC", help="Export only this topic; may be repeated.")
@json_option
def export_command(bag: Path, form: str, output: str, topics: tuple[str, ...], as_json: bool) -> None:
    """Convert BAG to CSV (a file per topic), to a recording for the rerun viewer, or to a rosbag2 folder.

    The last repairs an incomplete bag. The exit status is 1 if something could not be exported.
    """
    from deploy.bag_export import export_bag

    result = export_bag(bag, form, output, topics)
    if as_json:
        sys.stdout.write(json.dumps({"output": str(result.output), "troubles": result.problems}, indent=2) + "\n")
    else:
        sys.stdout.write(f"{result.text}\n")
    if result.problems:
        raise IncompleteBag("; ".join(result.problems))


def _parse_size(text: str) -> int:
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(k|M|G|Ki|Mi|Gi)?B?", text)
    if found is None:
        raise BadInput(f"--max-size {text!r} is not a size: write bytes, or 100M, 1.5Gi")
    return round(float(found[1]) * _UNITS[found[2] or ""])


def _exec_service(service: str, parameters: dict[str, Any], arguments: list[str]) -> None:
    """Replace this process by a service, after checking its parameters."""
    from services.catalog import load_service
    from services.runtime.parameters.validation import build

    build(
        load_service(service).parameters, {name: _plain(value) for name, value in parameters.items()}, f"bag {service}"
    )
    words = [w for name, value in parameters.items() for w in ("--param", f"{name}={json.dumps(value)}")]
    sys.stdout.flush()
    command_line = [sys.executable, "-P", "-m", "services", service, *arguments, *words]
    os.execve(sys.executable, command_line, {**os.environ, "PYTHONPATH": str(ROOT)})


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def print_info(info: BagInfo) -> None:
    """Print the contents of a bag."""
    begun = datetime.fromtimestamp(info.start).astimezone().isoformat(sep=" ", timespec="seconds")
    files = f"{len(info.files)} {'file' if len(info.files) == 1 else 'files'}"
    lines = [
        f"{info.path}: {_format_size(info.bytes)} in {files}",
        f"{info.messages} messages in {info.seconds:.2f} s simulated, {info.wall_seconds:.2f} s of wall time, "
        f"from {begun}",
        *_format_columns([("topic", "type", "messages", "Hz", ""), *map(_topic_row, info.topics)]),
    ]
    if len(info.files) > 1:
        lines.append("files: " + ", ".join(f"{each.name} ({_format_size(each.bytes)})" for each in info.files))
    lines += [f"lost on their way to the recorder: {count} messages of {topic}" for topic, count in info.lost.items()]
    if info.unwritten:
        lines.append(f"not written to the disk: {info.unwritten} messages")
    write_text("".join(f"{escape_unprintable(line)}\n" for line in lines))


def _topic_row(topic: TopicInfo) -> tuple[str, ...]:
    rate = "" if topic.rate is None else f"{topic.rate:.2f}"
    notes = ["latched"] if topic.latched else []
    notes += [] if topic.playable else [f"cannot be played: {topic.reason}"]
    return topic.topic, topic.type, str(topic.messages), rate, ", ".join(notes)


def _format_columns(rows: list[tuple[str, ...]]) -> list[str]:
    """Format columns: names left-aligned, numbers right-aligned, notes unchanged."""
    topic, kind, messages, rate, _ = (max(map(len, column)) for column in zip(*rows, strict=True))
    return [
        f"{each[0]:{topic}}  {each[1]:{kind}}  {each[2]:>{messages}}  {each[3]:>{rate}}  {each[4]}".rstrip()
        for each in rows
    ]


def _format_size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 10**6 else f"{count / 1e3:.1f} kB"
