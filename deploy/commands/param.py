"""``elea param``: the parameters of running services, like rosparam, ros2 param and dynparam."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from deploy.commands.completion import PARAMETER, SET
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import fleet_option, json_option
from deploy.live.output import format_table, write_json, write_text
from services.runtime.errors import BadInput, CallFailed, unknown_name
from services.runtime.network_address import resolve_address

if TYPE_CHECKING:
    from messages.parameters import ParameterSchema, ParameterValues, Value
    from services.runtime.parameters.service_client import ParameterServiceClient

COMMANDS = {
    "list": LazyCommand("param:list_command", "List the parameter sets, or the parameters of one."),
    "get": LazyCommand("param:get_command", "Show values and where they come from."),
    "describe": LazyCommand("param:describe_command", "Show types, bounds, defaults, units and descriptions."),
    "set": LazyCommand("param:set_command", "Set parameters, all or none."),
    "reset": LazyCommand("param:reset_command", "Reset parameters to the fleet file and defaults."),
    "undo": LazyCommand("param:undo_command", "Undo the last change of a set."),
    "dump": LazyCommand("param:dump_command", "Write values as YAML or TOML."),
    "load": LazyCommand("param:load_command", "Set values from a YAML or TOML file."),
    "history": LazyCommand("param:history_command", "Show the history of changes."),
}


@click.command(cls=LazyGroup, name="param", table=COMMANDS)
def command() -> None:
    """Read and change the parameters of running services, which the parameter service checks and stores.

    SET is the name of a parameter set as shown by `list`, with or without the leading slash, or of a node that uses it.

    Exit status: 0 done, 1 refused, failed, or outcome unknown because the answer was lost, 2 bad input.
    """


F = TypeVar("F", bound=Callable[..., Any])


def client_options(function: F) -> F:
    """Add ``--connect``, ``--domain``, ``--port``, ``--timeout`` and ``--json``."""
    options: tuple[Callable[..., Any], ...] = (
        json_option,
        click.option(
            "-t",
            "--timeout",
            type=click.FloatRange(0.1, 600),
            default=5.0,
            show_default=True,
            help="Time to wait, in seconds.",
        ),
        fleet_option,
        click.option("--domain", default="", help="Domain of the fleet."),
        click.option(
            "--connect", metavar="ENDPOINT", default="", help="Router to join; the running fleet's by default."
        ),
    )
    for option in options:
        function = option(function)
    return function


@contextmanager
def connect_client(options: dict[str, Any]) -> Iterator[ParameterServiceClient]:
    """Connect a client according to the options, and remove these from ``options``."""
    from services.runtime.light_node import open_transport
    from services.runtime.parameters.service_client import ParameterServiceClient

    address = resolve_address(*(options.pop(name) for name in ("connect", "domain", "port")))
    timeout = options.pop("timeout")
    with open_transport(address.router, address.domain) as transport:
        yield ParameterServiceClient(transport, timeout)


@click.command("list")
@click.argument("set_name", metavar="[SET]", default="", type=SET)
@click.option("-v", "--values", is_flag=True, help="Print a line `/SET/NAME VALUE` per parameter, for grep.")
@client_options
def list_command(set_name: str, values: bool, as_json: bool, **options: Any) -> None:
    """List the parameter sets with their parameters, or only SET."""
    with connect_client(options) as client:
        sets = client.sets()
        if set_name:
            from services.runtime.parameters.service_client import find_set

            sets = {(one := find_set(set_name, sets)).set: one}
        saved = {name: client.values(name) for name, each in sets.items() if values or not each.nodes}
    names = {
        name: [each.name for each in (saved[name].values if name in saved else one.parameters)]
        for name, one in sets.items()
    }
    if values:
        _print_values(saved, as_json)
        return
    if as_json:
        write_json([{"set": name, "nodes": list(one.nodes), "parameters": names[name]} for name, one in sets.items()])
        return
    for name, one in sets.items():
        nodes = f"  (followed by {', '.join(one.nodes)})" if one.nodes != (name,) else ""
        write_text(f"{name}{nodes if one.nodes else '  (saved; no running service has announced it)'}\n")
        write_text("".join(f"  {each}\n" for each in names[name]))


def _print_values(values_by_set: dict[str, ParameterValues], as_json: bool) -> None:
    from deploy.commands.param_values import format_value

    rows = [(f"{name}/{each.name}", each.value) for name, record in values_by_set.items() for each in record.values]
    if as_json:
        write_json(dict(rows))
    else:
        write_text("".join(f"{path} {format_value(value)}\n" for path, value in rows))


@click.command("get")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@client_options
def get_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Show the effective values of SET and their origins; for a single NAME, only the value.

    A single parameter may also be given as one path, e.g. `/tb3_0/waypoint/max_linear`.
    """
    import msgspec

    from deploy.commands.param_values import format_value, values_as_json

    with connect_client(options) as client:
        one, name = client.find_parameter(set_name) if not names else (client.find_set(set_name), "")
        record = client.values(one.set)
    names = (name,) if name else names
    known = {each.name: each for each in record.values}
    for name in names:
        if name not in known:
            raise unknown_name("parameter", name, known, record.set)
    if names:
        record = msgspec.structs.replace(record, values=tuple(known[name] for name in names))
    if as_json:
        write_json(values_as_json(record))
        return
    if len(names) == 1:
        sys.stdout.write(f"{format_value(record.values[0].value)}\n")
    elif record.values:
        rows = ((each.name, format_value(each.value), each.origin) for each in record.values)
        write_text(f"{format_table(rows)}\n")
    if record.note:
        sys.stderr.write(f"{record.set}: {record.note}\n")


@click.command("describe")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@client_options
def describe_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Show type, bounds, default, unit and description of the parameters of SET, or of some.

    Bounds, lengths, choices and constraints between parameters (`at most OTHER`, `not with OTHER`) are checked before
    a change takes effect.
    """
    import msgspec

    from deploy.commands.param_values import description_as_row

    with connect_client(options) as client:
        one = client.find_set(set_name)
    if not one.nodes:
        raise BadInput(f"no running service has announced {one.set}: its saved values have no description")
    described = {each.name: each for each in one.parameters}
    for name in names:
        if name not in described:
            raise unknown_name("parameter", name, described, one.set)
    chosen = [described[name] for name in names or described]
    if as_json:
        write_json({"set": one.set, "nodes": list(one.nodes), "parameters": msgspec.to_builtins(chosen)})
        return
    heads = ("NAME", "TYPE", "ALLOWED", "DEFAULT", "", "")
    write_text(f"{format_table((heads, *map(description_as_row, chosen)))}\n")


@click.command("history")
@click.argument("set_name", metavar="[SET]", default="", type=SET)
@click.option(
    "-n", "--limit", type=click.IntRange(1, 10_000), default=20, show_default=True, help="Maximum number of changes."
)
@client_options
def history_command(set_name: str, limit: int, as_json: bool, **options: Any) -> None:
    """Show the changes of SET, or of all sets, newest first: author, time, old and new values.

    At most 50 000 changes and 32 MiB are kept over all sets.
    """
    import msgspec

    from deploy.commands.param_values import change_as_row

    with connect_client(options) as client:
        changes = client.history(client.find_set(set_name).set if set_name else "", limit)
    if as_json:
        write_json(msgspec.to_builtins(changes))
    elif changes:
        write_text(f"{format_table(map(change_as_row, changes))}\n")
    else:
        sys.stdout.write("there are no changes yet\n")


@click.command("set", context_settings={"ignore_unknown_options": True})
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("words", metavar="NAME VALUE | NAME=VALUE... | {NAME: VALUE, ...}", nargs=-1, type=PARAMETER)
@click.option("--clamp", is_flag=True, help="Clamp numbers to their bounds instead of refusing them.")
@click.option("--run", is_flag=True, help="Set for this run only; do not save.")
@client_options
def set_command(set_name: str, words: tuple[str, ...], clamp: bool, run: bool, as_json: bool, **options: Any) -> None:
    """Set parameters of SET, all or none.

    Choices are not case-sensitive; a bool is yes, true, t, y, on or 1, and no, false, f, n, off or 0.

    If the answer is lost, the request is repeated with the same id, so that nothing is applied twice. Values are
    checked as shown by `describe`. A service may reject a value for other reasons, such as a deceleration of 0: it then
    undoes the change a moment later, and `history` shows why.
    """
    from deploy.commands.param_values import parse_assignments, to_assignments

    for word in words:
        if word.startswith("--") and word[2:3].isalpha():
            raise unknown_name(
                "option",
                word.partition("=")[0],
                ("--clamp", "--run", "--connect", "--domain", "--fleet", "--port", "--timeout", "--json"),
            )
    with connect_client(options) as client:
        one = client.find_set(set_name)
        before = client.values(one.set)
        values = parse_assignments(words, one) if one.nodes else {}
        after = client.set(one.set, to_assignments(values), clamp, run)
    _print_change(before, after, tuple(values), as_json)


@click.command("reset")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@client_options
def reset_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Reset SET, or some NAMEs, to the values of the command line, the fleet file and the defaults."""
    with connect_client(options) as client:
        one = client.find_set(set_name)
        before = client.values(one.set)
        known = {each.name for each in one.parameters} | {each.name for each in before.values}
        for name in names:
            if name not in known:
                raise unknown_name("parameter", name, known, one.set)
        after = client.reset(one.set, names)
    _print_change(before, after, _changed_names(before, after), as_json)


@click.command("undo")
@click.argument("set_name", metavar="SET", type=SET)
@client_options
def undo_command(set_name: str, as_json: bool, **options: Any) -> None:
    """Undo the last change of SET; run again for the one before. An undo cannot be undone."""
    with connect_client(options) as client:
        one = client.find_set(set_name)
        before = client.values(one.set)
        after = client.undo(one.set)
    _print_change(before, after, _changed_names(before, after), as_json)


def _changed_names(before: ParameterValues, after: ParameterValues) -> tuple[str, ...]:
    """Return the names whose value or origin has changed."""
    old = {each.name: each for each in before.values}
    new = {each.name: each for each in after.values}
    return tuple(name for name in dict.fromkeys((*old, *new)) if old.get(name) != new.get(name))


def _print_change(before: ParameterValues, after: ParameterValues, names: tuple[str, ...], as_json: bool) -> None:
    from deploy.commands.param_values import format_difference, values_as_json

    if as_json:
        write_json(values_as_json(after))
        return
    sys.stdout.write(format_difference(before, after, names))
    if after.note:
        sys.stderr.write(f"{after.set}: {after.note}\n")


class PlannedLoad(NamedTuple):
    """The effective values of a set, and the values to load."""

    before: ParameterValues
    values: dict[str, Value]


format_option = click.option(
    "--format",
    "form",
    type=click.Choice(["yaml", "toml"]),
    help="File format; by default from the file name, else YAML.",
)


@click.command("dump")
@click.argument("names", metavar="[SET]...", nargs=-1, type=SET)
@click.option("-o", "--output", metavar="FILE", default="", help="File to write; standard output by default.")
@format_option
@client_options
def dump_command(names: tuple[str, ...], output: str, form: str | None, as_json: bool, **options: Any) -> None:
    """Write the live parameters of the SETs, or of all, to a file for `load`."""
    from deploy.commands.param_values import file_format, format_tables
    from services.runtime.parameters.service_client import find_set

    chosen = file_format(output, form)
    with connect_client(options) as client:
        sets = client.sets()
        wanted = [find_set(name, sets) for name in names] or [each for each in sets.values() if each.nodes]
        tables = {each.set: table for each in wanted if (table := _loadable_values(client, each))}
    if as_json:
        return write_json(tables)
    if chosen == "toml":
        tables = {name: _without_null(name, table) for name, table in tables.items()}
    text = format_tables(tables, chosen)
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
@click.option(
    "--set", "only", metavar="SET", default="", help="Read FILE as the values of this set, without set names."
)
@click.option("--clamp", is_flag=True, help="Clamp numbers to their bounds instead of refusing them.")
@click.option("--run", is_flag=True, help="Set for this run only; do not save.")
@format_option
@client_options
def load_command(file: str, only: str, clamp: bool, run: bool, form: str | None, as_json: bool, **options: Any) -> None:
    """Set the values in FILE that differ; the whole FILE is checked first, and each set is all or none."""
    from deploy.commands.param_values import file_format, read_parameter_file

    tables = read_parameter_file(Path(file), file_format(file, form))
    if only:
        tables = {only: tables}
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise BadInput(
                f"{file}: {name} is not a table of values; if the file holds the values of one set, give --set SET"
            )
    with connect_client(options) as client:
        planned, faults = _plan_loads(client, tables, clamp)
        if faults:
            raise BadInput(f"{file}: {'; '.join(faults)}. Nothing was changed")
        _apply_loads(client, planned, clamp, run, as_json)


def _plan_loads(
    client: ParameterServiceClient, tables: dict[str, Any], clamp: bool
) -> tuple[list[PlannedLoad], list[str]]:
    """Return the sets to change, and all errors."""
    from deploy.commands.param_values import convert_values, validate_change
    from services.runtime.parameters.service_client import find_set

    sets, planned, faults = client.sets(), dict[str, PlannedLoad](), list[str]()
    for name, table in tables.items():
        try:
            one = find_set(name, sets)
            if one.set in planned:
                raise BadInput(f"the values of {one.set} are given twice, under two names")
            before = client.values(one.set)
            values = convert_values(table, one) if one.nodes else {}
            if values or not one.nodes:
                validate_change(one, before, values, clamp)
            planned[one.set] = PlannedLoad(before, values)
        except BadInput as error:
            faults.append(f"{name}: {error}")
    return list(planned.values()), faults


def _apply_loads(
    client: ParameterServiceClient, planned: list[PlannedLoad], clamp: bool, run: bool, as_json: bool
) -> None:
    """Set the values set by set, printing the changes; raises CallFailed if one is refused."""
    from deploy.commands.param_values import format_difference, to_assignments, values_as_json

    done: list[ParameterValues] = []
    for before, values in planned:
        other = {name: value for name, value in values.items() if _differs(before, name, value)}
        same = len(values) - len(other)
        after = before
        if other:
            try:
                after = client.set(before.set, to_assignments(other), clamp, run, "load")
            except CallFailed as error:
                loaded = ", ".join(each.set for each in done) or "nothing"
                raise type(error)(f"{before.set}: {error}; loaded before it: {loaded}") from None
        done.append(after)
        if not as_json:
            sys.stdout.write(format_difference(before, after, other))
            sys.stdout.write(f"{before.set}: {len(other)} changed, {same} as before\n")
            if other and after.note:
                sys.stderr.write(f"{before.set}: {after.note}\n")
    if as_json:
        write_json([values_as_json(each) for each in done])


def _loadable_values(client: ParameterServiceClient, one: ParameterSchema) -> dict[str, Value]:
    """Return the values of a set that ``load`` can set."""
    live = {each.name for each in one.parameters if each.live}
    return {each.name: each.value for each in client.values(one.set).values if each.name in live or not one.nodes}


def _without_null(name: str, table: dict[str, Value]) -> dict[str, Value]:
    nulls = [each for each, value in table.items() if value is None]
    if nulls:
        sys.stderr.write(f"{name}: TOML has no null, these are left out: {', '.join(nulls)} (YAML can hold them)\n")
    return {each: value for each, value in table.items() if value is not None}


def _differs(before: ParameterValues, name: str, value: Value) -> bool:
    return next((each.value for each in before.values if each.name == name), None) != value
