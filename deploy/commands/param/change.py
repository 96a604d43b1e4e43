"""``elea param set``, ``reset`` and ``undo``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import PARAMETER, SET
from deploy.commands.param.options import network, visiting
from services.runtime.errors import unknown

if TYPE_CHECKING:
    from messages.parameters import ParameterValues


@click.command("set", context_settings={"ignore_unknown_options": True})
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("words", metavar="NAME VALUE | NAME=VALUE... | {NAME: VALUE, ...}", nargs=-1, type=PARAMETER)
@click.option("--clamp", is_flag=True, help="Take a number that is out of bounds at the bound.")
@click.option("--run", is_flag=True, help="For this run alone: not saved.")
@network
def set_command(set_name: str, words: tuple[str, ...], clamp: bool, run: bool, as_json: bool, **options: Any) -> None:
    """Change parameters of SET, all or none.

    Names of choices are taken in any case; a bool is yes, true, t, y, on or 1, and no, false, f, n, off or 0.

    An answer that is lost is asked for again under the same id, so that nothing is applied twice. What `describe` tells
    is checked before a change counts. A service may find fault with more, such as a deceleration of 0: then it takes
    the change back a moment later, and `history` has its reason.
    """
    from deploy.commands.param.read import assigned, check, given

    for word in words:
        if word.startswith("--") and word[2:3].isalpha():
            raise unknown("option", word.partition("=")[0], ("--clamp", "--run", "--connect", "--domain", "--json"))
    with visiting(options) as client:
        one = client.one(set_name)
        before = client.values(one.set)
        values = given(words, one) if one.nodes else {}
        check(one, before, values, clamp)
        after = client.set(one.set, assigned(values), clamp, run)
    _say(before, after, tuple(values), as_json)


@click.command("reset")
@click.argument("set_name", metavar="SET", type=SET)
@click.argument("names", metavar="[NAME]...", nargs=-1, type=PARAMETER)
@network
def reset_command(set_name: str, names: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Forget what was set of SET, or of some NAMEs: command line, fleet file and defaults count again."""
    with visiting(options) as client:
        one = client.one(set_name)
        before = client.values(one.set)
        known = {each.name for each in one.parameters} | {each.name for each in before.values}
        for name in names:
            if name not in known:
                raise unknown("parameter", name, known, one.set)
        after = client.reset(one.set, names)
    _say(before, after, _changed(before, after), as_json)


@click.command("undo")
@click.argument("set_name", metavar="SET", type=SET)
@network
def undo_command(set_name: str, as_json: bool, **options: Any) -> None:
    """Take the newest change of SET back; once more takes the one before back. An undo itself is not taken back."""
    with visiting(options) as client:
        one = client.one(set_name)
        before = client.values(one.set)
        after = client.undo(one.set)
    _say(before, after, _changed(before, after), as_json)


def _changed(before: ParameterValues, after: ParameterValues) -> tuple[str, ...]:
    """Names whose value or origin has changed."""
    old = {each.name: each for each in before.values}
    new = {each.name: each for each in after.values}
    return tuple(name for name in dict.fromkeys((*old, *new)) if old.get(name) != new.get(name))


def _say(before: ParameterValues, after: ParameterValues, names: tuple[str, ...], as_json: bool) -> None:
    from deploy.commands.param.show import difference, print_json, values_as_json

    if as_json:
        print_json(values_as_json(after))
        return
    sys.stdout.write(difference(before, after, names))
    if after.note:
        sys.stderr.write(f"{after.set}: {after.note}\n")
