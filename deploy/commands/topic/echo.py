"""``elea topic echo``: the messages of a topic."""

from __future__ import annotations

from typing import Any

import click

from deploy.commands.completion import FIELD, TYPE
from deploy.commands.options import json_option, place_options
from deploy.commands.topic.shared import timeout_option, topic_argument, wait_option
from deploy.place import Place


@click.command("echo")
@topic_argument
@click.argument("type_name", metavar="[TYPE]", default="", type=TYPE)
@click.option("--once", is_flag=True, help="End after one message.")
@click.option("-n", "--count", type=click.IntRange(1), help="End after N messages.")
@click.option("--field", "fields", multiple=True, type=FIELD, help="A part: pose.pose.position, ranges[0]; repeatable.")
@click.option("--csv", "-p", "as_csv", is_flag=True, help="A row of CSV for each message, below a row of names.")
@click.option("--no-header", is_flag=True, help="CSV without the row of names.")
@click.option("--no-arr", "--noarr", is_flag=True, help="Lists by their length alone.")
@click.option("--no-str", "--nostr", is_flag=True, help="Texts by their length alone.")
@click.option("-f", "--full-length", is_flag=True, help="Lists and texts in full length; CSV and JSON are so anyway.")
@click.option("-l", "--truncate-length", type=click.IntRange(1), help="Elements shown of a list; 128 by default.")
@click.option("--flow-style", is_flag=True, help="Each message on one line.")
@click.option("--include-message-info", "with_info", is_flag=True, help="Show number, sender and times of each sample.")
@timeout_option
@wait_option
@place_options
@json_option
def command(
    topic: str,
    type_name: str,
    once: bool,
    count: int | None,
    fields: tuple[str, ...],
    timeout: float | None,
    wait: bool,
    place: Place,
    as_json: bool,
    **style: Any,
) -> None:
    """Show the messages of TOPIC as YAML, until Ctrl-C; with --json, each as one line.

    TYPE is needed only for a sender that does not tell it. What is of a type that is not known here is shown all the
    same. With --timeout the status is 1 when the messages did not come in time.
    """
    from deploy.live.echo import Echo, Style, echo
    from services.runtime.errors import BadInput

    if as_json and style["as_csv"]:
        raise BadInput("--json and --csv exclude each other")
    if once and count not in (None, 1):
        raise BadInput(f"--once and -n {count} exclude each other")
    most = style.pop("truncate_length")
    asked = Echo(topic, type_name, fields, 1 if once else count or 0, timeout, wait)
    raise SystemExit(echo(place, asked, Style(as_json=as_json, most=most, **style)))
