"""``elea param dump`` and ``load``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from deploy.commands.completion import SET
from deploy.commands.param.options import network, visiting
from services.runtime.errors import BadInput, CallFailed

if TYPE_CHECKING:
    from deploy.commands.param.client import Client
    from messages.parameters import ParameterSchema, ParameterValues, Value


class Plan(NamedTuple):
    """The values of a set that count, and those that a file has for it."""

    before: ParameterValues
    values: dict[str, Value]


format_option = click.option(
    "--format", "form", type=click.Choice(["yaml", "toml"]), help="By the ending of the file, else YAML."
)


@click.command("dump")
@click.argument("names", metavar="[SET]...", nargs=-1, type=SET)
@click.option("-o", "--output", metavar="FILE", default="", help="Write here; standard output by default.")
@format_option
@network
def dump_command(names: tuple[str, ...], output: str, form: str | None, as_json: bool, **options: Any) -> None:
    """Write the values of the SETs, or of all, for `load`: those that may be set while services run."""
    from deploy.commands.param.client import found
    from deploy.commands.param.files import format_of, write_tables
    from deploy.commands.param.show import print_json

    chosen = format_of(output, form)
    with visiting(options) as client:
        sets = client.sets()
        wanted = [found(name, sets) for name in names] or [each for each in sets.values() if each.nodes]
        tables = {each.set: table for each in wanted if (table := _values(client, each))}
    if as_json:
        return print_json(tables)
    if chosen == "toml":
        tables = {name: _without_null(name, table) for name, table in tables.items()}
    text = write_tables(tables, chosen)
    if not output:
        sys.stdout.write(text)
        return None
    try:
        Path(output).write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"cannot write {output}: {error.strerror}") from None
    return None


@click.command("load")
@click.argument("file", type=click.Path())
@click.option("--set", "only", metavar="SET", default="", help="FILE has the values of this set, without its name.")
@click.option("--clamp", is_flag=True, help="Take a number that is out of bounds at the bound.")
@click.option("--run", is_flag=True, help="For this run alone: not saved.")
@format_option
@network
def load_command(file: str, only: str, clamp: bool, run: bool, form: str | None, as_json: bool, **options: Any) -> None:
    """Set what in FILE differs from the values that count; all of FILE is checked first, each set is all or none."""
    from deploy.commands.param.files import format_of, read_file

    tables = read_file(Path(file), format_of(file, form))
    if only:
        tables = {only: tables}
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise BadInput(f"{file}: {name} is no table of a set; if the file has the values of one set, say --set SET")
    with visiting(options) as client:
        planned, faults = _planned(client, tables, clamp)
        if faults:
            raise BadInput(f"{file}: {'; '.join(faults)}. Nothing was changed")
        _carry_out(client, planned, clamp, run, as_json)


def _planned(client: Client, tables: dict[str, Any], clamp: bool) -> tuple[list[Plan], list[str]]:
    """What to set, and what is wrong with it."""
    from deploy.commands.param.client import found
    from deploy.commands.param.read import check, fitting

    sets, planned, faults = client.sets(), dict[str, Plan](), list[str]()
    for name, table in tables.items():
        try:
            one = found(name, sets)
            if one.set in planned:
                raise BadInput(f"the values of {one.set} are given twice, under two names")
            before = client.values(one.set)
            values = fitting(table, one) if one.nodes else {}
            if values or not one.nodes:
                check(one, before, values, clamp)
            planned[one.set] = Plan(before, values)
        except BadInput as error:
            faults.append(f"{name}: {error}")
    return list(planned.values()), faults


def _carry_out(client: Client, planned: list[Plan], clamp: bool, run: bool, as_json: bool) -> None:
    """Set by set, saying what was changed; raises CallFailed, after saying it, when one is refused."""
    from deploy.commands.param.read import assigned
    from deploy.commands.param.show import difference, print_json, values_as_json

    done: list[ParameterValues] = []
    for before, values in planned:
        other = {name: value for name, value in values.items() if _differs(before, name, value)}
        same = len(values) - len(other)
        after = before
        if other:
            try:
                after = client.set(before.set, assigned(other), clamp, run, "load")
            except CallFailed as error:
                loaded = ", ".join(each.set for each in done) or "nothing"
                raise type(error)(f"{before.set}: {error}; loaded before it: {loaded}") from None
        done.append(after)
        if not as_json:
            sys.stdout.write(difference(before, after, other))
            sys.stdout.write(f"{before.set}: {len(other)} changed, {same} as before\n")
            if other and after.note:
                sys.stderr.write(f"{before.set}: {after.note}\n")
    if as_json:
        print_json([values_as_json(each) for each in done])


def _values(client: Client, one: ParameterSchema) -> dict[str, Value]:
    """The values of a set that `load` may set again."""
    live = {each.name for each in one.parameters if each.live}
    return {each.name: each.value for each in client.values(one.set).values if each.name in live or not one.nodes}


def _without_null(name: str, table: dict[str, Value]) -> dict[str, Value]:
    nulls = [each for each, value in table.items() if value is None]
    if nulls:
        sys.stderr.write(f"{name}: TOML has no null, left out: {', '.join(nulls)} (YAML has)\n")
    return {each: value for each, value in table.items() if value is not None}


def _differs(before: ParameterValues, name: str, value: Value) -> bool:
    return next((each.value for each in before.values if each.name == name), None) != value
