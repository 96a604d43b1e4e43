"""What an announcement makes of a set: its schema, its saved values under it, and what there is to tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from messages.parameters import Announcement, Value
from services.params.check import fit
from services.params.migrate import migrate
from services.params.state import State, same
from services.runtime.errors import BadInput

Owners = Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class Arrival:
    """The set after an announcement; ``described`` and ``news`` tell whether schema and values are to be published.

    ``changed`` names the saved values that were ``migrated``, with a text for each; ``notes`` are for who listens.
    """

    state: State
    owners: Owners
    node: str
    owned: tuple[str, ...]
    described: bool
    news: bool
    changed: tuple[str, ...]
    migrated: tuple[str, ...]
    notes: tuple[str, ...]


def announced(before: State, joined: State, asked: Announcement, owners: Owners) -> Arrival:
    """What becomes of the set ``before`` when a node has announced, which gave the schema of ``joined``."""
    migration = migrate(joined.saved, joined.schema, owners)
    run, dropped = _run(joined)
    state = replace(joined, saved=migration.saved, run=run)
    new = asked.node not in before.schema.announced
    described = new or before.schema.record(before.name) != state.schema.record(state.name)
    news = new or bool(migration.names) or _differs(before, state)
    if news:
        state = replace(state, revision=before.revision + 1)
    live = tuple(each.name for each in asked.parameters if each.live)
    migrated = (*migration.texts, *dropped)
    return Arrival(
        state=state,
        owners=_owned(owners, asked.node, live, migration.saved),
        node=asked.node,
        owned=live,
        described=described,
        news=news,
        changed=migration.names,
        migrated=migrated,
        notes=(*migrated, *migration.waiting),
    )


def _run(state: State) -> tuple[dict[str, Value], list[str]]:
    """The values of this run that fit the schema, and a text for each that does not."""
    kept: dict[str, Value] = {}
    dropped = []
    for name, value in state.run.items():
        described = state.schema.parameters.get(name)
        try:
            kept[name] = value if described is None else fit(described, value).value
        except BadInput as error:
            dropped.append(f"the value of this run was left out: {error}")
    return kept, dropped


def _differs(before: State, after: State) -> bool:
    old, new = before.values(), after.values()
    return old.keys() != new.keys() or any(
        not same(old[name].value, new[name].value) or old[name].origin != new[name].origin for name in old
    )


def _owned(owners: Owners, node: str, names: tuple[str, ...], saved: Mapping[str, Value]) -> dict[str, frozenset[str]]:
    """Who has which parameter now, as far as it is known."""
    others = {name: nodes - {node} for name, nodes in owners.items()}
    mine = {name: others.get(name, frozenset()) | {node} for name in names}
    return {name: nodes for name, nodes in {**others, **mine}.items() if nodes or name in saved}
