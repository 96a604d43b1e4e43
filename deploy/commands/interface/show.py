"""``elea interface show``: the fields of a type, or what a request asks and replies."""

from __future__ import annotations

from typing import Any

import click

from deploy.commands.options import json_option


@click.command("show")
@click.argument("name", metavar="TYPE")
@json_option
def command(name: str, as_json: bool) -> None:
    """Show TYPE, as geometry_msgs/Twist or geometry_msgs/msg/Twist, or the request of a name, as /sim/spawn.

    Every field with its type, unit, bounds and default, those of the records within below it.
    """
    from deploy.interfaces import described, find
    from deploy.live.output import say, say_json
    from messages.requests import Request

    found = find(name)
    if not isinstance(found, Request):
        record = described(found)
        if as_json:
            say_json(record)
        else:
            say(drawn(record))
        return
    asks, replies = described(found.asks), described(found.replies)
    if as_json:
        say_json({"name": found.name, "about": found.about, "asks": asks, "replies": replies})
    else:
        say(f"{found.name}: {found.about}\n\n{drawn(asks)}---\n{drawn(replies)}")


def drawn(record: dict[str, Any]) -> str:
    """A record as text: what it is, where it is used, its constants, its fields."""
    lines = [record["type"], *(f"# {line}".rstrip() for line in record["about"].splitlines())]
    for title, names in (("topics", record["topics"]), ("requests", record["requests"])):
        if names:
            lines.append(f"# {title}: {', '.join(names)}")
    lines += [f"{name} = {value!r}" for name, value in record["constants"].items()]
    rows = _rows(record["fields"], 0)
    widths = [max((len(row[column]) for row in rows), default=0) for column in (0, 1)]
    for left, middle, right in rows:
        lines.append(f"{left:<{widths[0]}}  {middle:<{widths[1]}}  {right}".rstrip())
    return "\n".join(lines) + "\n"


def _rows(fields: list[dict[str, Any]], depth: int) -> list[tuple[str, str, str]]:
    """Name, type, and what else there is to say of each field."""
    rows = []
    for each in fields:
        facts = [each["unit"], each["bounds"], " or ".join(map(repr, each["choices"]))]
        facts += ["may be null"] if each["optional"] else []
        facts += [] if each["default"] is None else [f"{each['default']!r} by default"]
        said = ", ".join(fact for fact in facts if fact) or each["about"].partition("\n")[0]
        rows.append(("  " * (depth + 1) + each["name"], each["type"], said and f"# {said}"))
        rows += _rows(each["fields"], depth + 1)
    return rows
