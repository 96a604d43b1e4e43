"""``elea param list``, ``get``, ``describe`` and ``history``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import PARAMETER, SET
from deploy.commands.param.options import network, visiting

if TYPE_CHECKING:
    from messages.parameters import ParameterValues


@click.command("list")
@click.argument("set_name", metavar="[SET]", default="", type=SET)
@click.option("-v", "--values", is_flag=True, help="A line `/SET/NAME VALUE` for each parameter, as grep wants it.")
@network
def list_command(set_name: str, values: bool, as_json: bool, **options: Any) -> None:
    """List the sets with the names of their parameters, or those of SET."""
    from deploy.commands.param.show import print_json

    with visiting(options) as client:
        sets = client.sets()
        if set_name:
            from deploy.commands.param.client import found

            sets = {(one := found(set_name, sets)).set: one}
        saved = {name: client.values(name) for name, each in sets.items() if values or not each.nodes}
    names = {
        name: [each.name for each in (saved[name].values if name in saved else one.parameters)]
        for name, one in sets.items()
    }
    from deploy.live.output import say

    if values:
        _list_values(saved, as_json)
        return
    if as_json:
        print_json([{"set": name, "nodes": list(one.nodes), "parameters": names[name]} for name, one in sets.items()])
        return
    for name, one in sets.items():
        nodes = f"  (followed by {', '.join(one.nodes)})" if one.nodes != (name,) else ""
        say(f"{name}{nodes if one.nodes else '  (saved; no running service has announced it)'}\n")
        say("".join(f"  {each}\n" for each in names[name]))


def _list_values(told: dict[str, ParameterValues], as_json: bool) -> None:
    from deploy.commands.param.show import print_json, text_of
    from deploy.live.output import say

    rows = [(f"{name}/{each.name}", each.value) for name, record in told.items() for each in record.values]
    if as_json:
        print_json(dict(rows))
    else:
        say("".join(f"{path} {text_of(value)}\n" for path, value in rows))


@click.command("get")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@network
def get_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Show the values of SET that count and where they come from; of one NAME, the bare value.

    A single parameter may be named in one path, as `/tb3_0/waypoint/max_linear`.
    """
    import msgspec

    from deploy.commands.param.show import columns, print_json, text_of, values_as_json
    from services.runtime.errors import unknown

    with visiting(options) as client:
        one, name = client.one_of(set_name) if not names else (client.one(set_name), "")
        record = client.values(one.set)
    names = (name,) if name else names
    known = {each.name: each for each in record.values}
    for name in names:
        if name not in known:
            raise unknown("parameter", name, known, record.set)
    if names:
        record = msgspec.structs.replace(record, values=tuple(known[name] for name in names))
    if as_json:
        print_json(values_as_json(record))
        return
    if len(names) == 1:
        sys.stdout.write(f"{text_of(record.values[0].value)}\n")
    elif record.values:
        sys.stdout.write(columns((each.name, text_of(each.value), each.origin) for each in record.values))
    if record.note:
        sys.stderr.write(f"{record.set}: {record.note}\n")


@click.command("describe")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@network
def describe_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Show type, bounds, default, unit and text of the parameters of SET, or of some.

    Bounds, lengths, choices, and what must hold between two parameters (`at most OTHER`, `not with OTHER`) are checked
    before a change counts.
    """
    import msgspec

    from deploy.commands.param.show import columns, description_as_row, print_json
    from services.runtime.errors import BadInput, unknown

    with visiting(options) as client:
        one = client.one(set_name)
    if not one.nodes:
        raise BadInput(f"no running service has announced {one.set}: its saved values have no description")
    described = {each.name: each for each in one.parameters}
    for name in names:
        if name not in described:
            raise unknown("parameter", name, described, one.set)
    chosen = [described[name] for name in names or described]
    if as_json:
        print_json({"set": one.set, "nodes": list(one.nodes), "parameters": msgspec.to_builtins(chosen)})
        return
    heads = ("NAME", "TYPE", "ALLOWED", "DEFAULT", "", "")
    sys.stdout.write(columns((heads, *map(description_as_row, chosen))))


@click.command("history")
@click.argument("set_name", metavar="[SET]", default="", type=SET)
@click.option("-n", "--limit", type=click.IntRange(1, 10_000), default=20, show_default=True, help="So many at most.")
@network
def history_command(set_name: str, limit: int, as_json: bool, **options: Any) -> None:
    """Show the changes of SET, or of all, newest first: who, when, from what to what.

    The newest 50 000 changes, and 32 MiB, of all sets together are kept.
    """
    import msgspec

    from deploy.commands.param.show import change_as_row, columns, print_json

    with visiting(options) as client:
        changes = client.history(client.one(set_name).set if set_name else "", limit)
    if as_json:
        print_json(msgspec.to_builtins(changes))
    elif changes:
        sys.stdout.write(columns(map(change_as_row, changes)))
    else:
        sys.stdout.write("nothing was changed yet\n")
