"""``elea topic list``: the topics of the network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from deploy.commands.options import json_option, place_options
from deploy.place import Place

if TYPE_CHECKING:
    from deploy.live.ends import Ends
    from deploy.live.session import Session


@click.command("list")
@click.option("-t", "--show-types", is_flag=True, help="Show the types.")
@click.option("-v", "--verbose", is_flag=True, help="Show types, qualities, publishers and subscribers.")
@click.option("-c", "--count-topics", is_flag=True, help="Show how many there are.")
@click.option(
    "--listen", type=click.FloatRange(0, 60), default=0.0, metavar="S", help="Listen S seconds for undeclared topics."
)
@place_options
@json_option
def command(show_types: bool, verbose: bool, count_topics: bool, listen: float, place: Place, as_json: bool) -> None:
    """List the topics that somebody publishes or subscribes.

    A program that is not of this project declares nothing: --listen shows the topics that it sends meanwhile.
    """
    from deploy.live.ends import topics
    from deploy.live.output import say, say_json
    from deploy.live.session import session
    from services.runtime.graph import snapshot

    with session(place, "list") as live:
        found = topics(snapshot(live.transport))
        foreign = _heard(live, listen) if listen else {}
    rows = [_row(each) for each in found.values()]
    rows += [{**_row_of(name), "types": types} for name, types in foreign.items() if name not in found]
    rows.sort(key=lambda each: str(each["name"]))
    if as_json:
        say_json(rows)
    elif count_topics:
        say(f"{len(rows)}\n")
    else:
        say("".join(_line(each, show_types, verbose) for each in rows))


def _heard(live: Session, seconds: float) -> dict[str, list[str]]:
    """Topics with samples on them that nobody of this project sent, and the types that these tell."""
    from messages.names import BadName, name_of
    from services.runtime.network.wire import FORMAT, detach

    inlet, found = live.transport.subscribe("**", 8192), dict[str, list[str]]()
    for _ in live.turns(inlet, seconds):
        while (sample := inlet.take()) is not None:
            _, attachment, source = sample
            if detach(attachment) is not None:
                continue
            try:
                types = found.setdefault(name_of(inlet.key(source)), [])
            except BadName:
                continue
            form, _, type_name = inlet.encoding(source).partition(";")
            if form == FORMAT and type_name and type_name not in types:
                types.append(type_name)
    return found


def _row_of(name: str) -> dict[str, Any]:
    from deploy.live.known import topic_of

    known = topic_of(name)
    return {
        "name": name,
        "types": [],
        "quality": "",
        "promised": known.rate if known is not None and known.rate else None,
        "about": known.about if known is not None else "",
        "publishers": [],
        "subscribers": [],
    }


def _row(ends: Ends) -> dict[str, Any]:
    from deploy.live.ends import is_hidden

    shown = [each for each in ends.subscribers if not is_hidden(each.node)]
    return {
        **_row_of(ends.name),
        "types": list(ends.types),
        "quality": next((each.detail.lower() for each in (*ends.publishers, *ends.subscribers)), ""),
        "publishers": [each.node for each in ends.publishers],
        "subscribers": [each.node for each in shown],
    }


def _line(row: dict[str, Any], types: bool, verbose: bool) -> str:
    kinds = ", ".join(row["types"]) or "?"
    if not verbose:
        return f"{row['name']} [{kinds}]\n" if types else f"{row['name']}\n"
    quality = f", {row['quality']}" if row["quality"] else ", foreign"
    promised = f", {row['promised']:g} Hz" if row["promised"] else ""
    ends = "".join(
        f"  {arrow} {', '.join(row[who])}\n" for arrow, who in (("<-", "publishers"), ("->", "subscribers")) if row[who]
    )
    return f"{row['name']} [{kinds}{quality}{promised}]\n{ends}"
