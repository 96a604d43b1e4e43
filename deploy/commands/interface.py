"""``elea interface``: the types of messages and services."""

from __future__ import annotations

from typing import Any

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option

COMMANDS = {
    "list": LazyCommand("interface:list_command", "List the message and service types."),
    "show": LazyCommand("interface:show_command", "Show the fields of a message or service type."),
}


@click.command("interface", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """List message and service types or show one. Needs no network."""


@click.command("list")
@click.argument("package", default="")
@click.option("-m", "--only-msgs", is_flag=True, help="List only messages.")
@click.option("-s", "--only-srvs", is_flag=True, help="List only services.")
@json_option
def list_command(package: str, only_msgs: bool, only_srvs: bool, as_json: bool) -> None:
    """List all message and service types, or those of PACKAGE, e.g. geometry_msgs."""
    from deploy.interfaces import list_types
    from deploy.live.output import write_json, write_text

    found = list_types(package)
    if only_msgs:
        del found["requests"]
    elif only_srvs:
        del found["messages"]
    if as_json:
        write_json(found)
        return
    lines = []
    for title, rows in found.items():
        names = [each.get("name") or each["type"] for each in rows]
        width = max(map(len, names), default=0)
        lines.append(f"{title.capitalize()}:")
        for name, row in zip(names, rows, strict=True):
            what = f"{row['asks']} -> {row['replies']}: {row['about']}" if "asks" in row else row["about"]
            lines.append(f"  {name:<{width}}  {what}".rstrip())
    write_text("\n".join(lines) + "\n")


@click.command("show")
@click.argument("name", metavar="TYPE")
@json_option
def show_command(name: str, as_json: bool) -> None:
    """Show TYPE, e.g. geometry_msgs/Twist or geometry_msgs/msg/Twist, or a service, e.g. /sim/spawn.

    Each field is shown with its type, unit, bounds and default; nested records are indented below it.
    """
    from deploy.interfaces import describe_type, find_interface
    from deploy.live.output import write_json, write_text
    from messages.requests import Request

    found = find_interface(name)
    if not isinstance(found, Request):
        record = describe_type(found)
        if as_json:
            write_json(record)
        else:
            write_text(format_type(record))
        return
    asks, replies = describe_type(found.request_type), describe_type(found.response_type)
    if as_json:
        write_json({"name": found.name, "about": found.about, "asks": asks, "replies": replies})
    else:
        write_text(f"{found.name}: {found.about}\n\n{format_type(asks)}---\n{format_type(replies)}")


def format_type(record: dict[str, Any]) -> str:
    """Format a record: description, uses, constants and fields."""
    lines = [record["type"], *(f"# {line}".rstrip() for line in record["about"].splitlines())]
    for title, names in (("topics", record["topics"]), ("requests", record["requests"])):
        if names:
            lines.append(f"# {title}: {', '.join(names)}")
    lines += [f"{name} = {value!r}" for name, value in record["constants"].items()]
    rows = _field_rows(record["fields"], 0)
    widths = [max((len(row[column]) for row in rows), default=0) for column in (0, 1)]
    for left, middle, right in rows:
        lines.append(f"{left:<{widths[0]}}  {middle:<{widths[1]}}  {right}".rstrip())
    return "\n".join(lines) + "\n"


def _field_rows(fields: list[dict[str, Any]], depth: int) -> list[tuple[str, str, str]]:
    """Return name, type and remarks of each field."""
    rows = []
    for each in fields:
        facts = [each["unit"], each["bounds"], " or ".join(map(repr, each["choices"]))]
        facts += ["may be null"] if each["optional"] else []
        facts += [] if each["default"] is None else [f"{each['default']!r} by default"]
        remark = ", ".join(fact for fact in facts if fact) or each["about"].partition("\n")[0]
        rows.append(("  " * (depth + 1) + each["name"], each["type"], remark and f"# {remark}"))
        rows += _field_rows(each["fields"], depth + 1)
    return rows
