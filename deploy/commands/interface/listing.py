"""``elea interface list``: the types of messages, and the requests."""

from __future__ import annotations

import click

from deploy.commands.options import json_option


@click.command("list")
@click.argument("package", default="")
@click.option("-m", "--only-msgs", is_flag=True, help="Messages alone.")
@click.option("-s", "--only-srvs", is_flag=True, help="Requests alone.")
@json_option
def command(package: str, only_msgs: bool, only_srvs: bool, as_json: bool) -> None:
    """List all types of messages and all requests, or those of PACKAGE, as geometry_msgs."""
    from deploy.interfaces import listed
    from deploy.live.output import say, say_json

    found = listed(package)
    if only_msgs:
        del found["requests"]
    elif only_srvs:
        del found["messages"]
    if as_json:
        say_json(found)
        return
    lines = []
    for title, rows in found.items():
        names = [each.get("name") or each["type"] for each in rows]
        width = max(map(len, names), default=0)
        lines.append(f"{title.capitalize()}:")
        for name, row in zip(names, rows, strict=True):
            what = f"{row['asks']} -> {row['replies']}: {row['about']}" if "asks" in row else row["about"]
            lines.append(f"  {name:<{width}}  {what}".rstrip())
    say("\n".join(lines) + "\n")
