"""``elea param list``, ``get``, ``describe`` and ``history``."""

from __future__ import annotations

import sys
from typing import Any

import click

from deploy.commands.completion import PARAMETER, SET
from deploy.commands.param.options import network, visiting


@click.command("list")
@click.argument("set_name", metavar="[SET]", default="", type=SET)
@network
def list_command(set_name: str, as_json: bool, **options: Any) -> None:
    """List the sets with the names of their parameters, or those of SET."""
    from deploy.commands.param.show import print_json

    with visiting(options) as client:
        sets = client.sets()
        if set_name:
            from deploy.commands.param.client import found

            sets = {(one := found(set_name, sets)).set: one}
        saved = {name: client.values(name) for name, each in sets.items() if not each.nodes}
    names = {
        name: [each.name for each in (saved[name].values if name in saved else one.parameters)]
        for name, one in sets.items()
    }
    if as_json:
        print_json([{"set": name, "nodes": list(one.nodes), "parameters": names[name]} for name, one in sets.items()])
        return
    for name, one in sets.items():
        nodes = f"  (followed by {', '.join(one.nodes)})" if one.nodes != (name,) else ""
        sys.stdout.write(f"{name}{nodes if one.nodes else '  (saved; no running service has announced it)'}\n")
        sys.stdout.writelines(f"  {each}\n" for each in names[name])


@click.command("get")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@network
def get_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Show the values of SET that count and where they come from; of one NAME, the bare value."""
    import msgspec

    from deploy.commands.param.show import columns, print_json, text_of, values_as_json
    from services.runtime.errors import unknown

    with visiting(options) as client:
        record = client.values(client.one(set_name).set)
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
