"""Changes of a parameter set, planned before they are applied: announce, migrate, set, reset, undo."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import islice

from messages.parameters import Announcement, ParameterDescription, ResetParameters, SetParameters, Value
from services.params.schema import Schema, SetState, same_value
from services.params.value_check import fit, format_value, parse_type
from services.runtime.errors import BadInput, nearest, unknown_name
from services.runtime.parameters.renamed_choices import renamed_choice
from services.runtime.parameters.schema import violations

_MOST_HINTS = 10
"""Values that are left out with a guess at their new name: each is compared with all names."""


@dataclass(frozen=True)
class Migration:
    """What saved values became: ``saved`` as they count now, the ``names`` of those that changed, and why."""

    saved: Mapping[str, Value]
    names: tuple[str, ...]
    texts: tuple[str, ...]
    waiting: tuple[str, ...] = ()


def migrate(saved: Mapping[str, Value], schema: Schema, owners: Mapping[str, Collection[str]]) -> Migration:
    """Fit saved values to the schema. ``owners`` are the nodes that had each parameter when it was last announced.

    An int becomes a float and a whole float an int; a renamed choice gets its new name. What is out of the new bounds
    is left out, not clamped: a bound is a value that nobody chose. A name that all its owners no longer announce is
    left out, and a new name for it is not guessed; one that waits for an owner to announce is kept as it is.
    """
    kept: dict[str, Value] = {}
    names: list[str] = []
    texts: list[str] = []
    waiting: list[str] = []
    for name, value in saved.items():
        described = schema.parameters.get(name)
        if described is None and not set(owners.get(name, ())) <= set(schema.announced):
            kept[name] = value
            waiting.append(f"{name} = {format_value(value)} is kept for {', '.join(sorted(owners[name])[:10])}")
            continue
        try:
            new = _fitted(described, name, value, schema, len(texts) < _MOST_HINTS)
        except BadInput as error:
            names.append(name)
            texts.append(f"saved {name} = {format_value(value)} was left out: {error}")
            continue
        kept[name] = new
        if repr(new) != repr(value):
            assert described is not None
            why = "the choice was renamed" if described.choices else f"its type is {described.type} now"
            names.append(name)
            texts.append(f"saved {name} = {format_value(value)} became {format_value(new)}: {why}")
    return Migration(kept, tuple(names), tuple(texts), tuple(waiting))


def _fitted(described: ParameterDescription | None, name: str, value: Value, schema: Schema, hints: bool) -> Value:
    if described is None:
        near = nearest(name, schema.parameters) if hints else []
        hint = f" (if it is called {near[0]} now, set that)" if near else ""
        raise BadInput(f"no parameter has this name any more{hint}")
    if not described.live:
        raise BadInput("it is for the fleet file or the command line to say now")
    whole = _whole(value) if parse_type(described.type) == ("int", 0) else value
    return fit(described, renamed_choice(whole, described.choices) or whole).value


def _whole(value: Value) -> Value:
    return int(value) if isinstance(value, float) and value.is_integer() else value


Owners = Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class AnnounceResult:
    """The set after an announcement; ``described`` and ``news`` tell whether schema and values are to be published.

    ``changed`` names the saved values that were ``migrated``, with a text for each; ``notes`` are for who listens.
    """

    state: SetState
    owners: Owners
    node: str
    owned: tuple[str, ...]
    schema_changed: bool
    values_changed: bool
    migrated_names: tuple[str, ...]
    migration_notes: tuple[str, ...]
    notes: tuple[str, ...]


def apply_announcement(before: SetState, joined: SetState, asked: Announcement, owners: Owners) -> AnnounceResult:
    """What becomes of the set ``before`` when a node has announced, which gave the schema of ``joined``."""
    joined = replace(joined, run={**_remembered_run_values(before, asked), **joined.run})
    migration = migrate(joined.saved, joined.schema, owners)
    run, dropped = _fitting_run_values(joined)
    state = replace(joined, saved=migration.saved, run=run)
    new = asked.node not in before.schema.announced
    described = new or before.schema.to_message(before.name) != state.schema.to_message(state.name)
    news = new or bool(migration.names) or _differs(before, state)
    if news:
        state = replace(state, revision=before.revision + 1)
    live = tuple(each.name for each in asked.parameters if each.live)
    migrated = (*migration.texts, *dropped)
    return AnnounceResult(
        state=state,
        owners=_updated_owners(owners, asked.node, live, migration.saved),
        node=asked.node,
        owned=live,
        schema_changed=described,
        values_changed=news,
        migrated_names=migration.names,
        migration_notes=migrated,
        notes=(*migrated, *migration.waiting),
    )


def _remembered_run_values(before: SetState, asked: Announcement) -> dict[str, Value]:
    """Values of this run that a node still has from before this service was started anew."""
    if asked.node in before.schema.announced:
        return {}
    live = {each.name for each in asked.parameters if each.live}
    return {each.name: each.value for each in asked.run if each.name in live}


def _fitting_run_values(state: SetState) -> tuple[dict[str, Value], list[str]]:
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


def _differs(before: SetState, after: SetState) -> bool:
    old, new = before.effective_values(), after.effective_values()
    return old.keys() != new.keys() or any(
        not same_value(old[name].value, new[name].value) or old[name].origin != new[name].origin for name in old
    )


def _updated_owners(
    owners: Owners, node: str, names: tuple[str, ...], saved: Mapping[str, Value]
) -> dict[str, frozenset[str]]:
    """Who has which parameter now, as far as it is known."""
    others = {name: nodes - {node} for name, nodes in owners.items()}
    mine = {name: others.get(name, frozenset()) | {node} for name in names}
    return {name: nodes for name, nodes in {**others, **mine}.items() if nodes or name in saved}


Layer = dict[str, Value]

MAX_VIOLATIONS = 10
"""Violations that one refusal names."""


@dataclass(frozen=True)
class UndoPatch:
    """What an undo restores: the layers of the parameters ``names`` before the change; a name missing was not set."""

    names: tuple[str, ...]
    saved: Mapping[str, Value]
    run: Mapping[str, Value]


@dataclass(frozen=True)
class Change:
    """A set before and after, and what to say of it. ``run`` tells that nothing of it is saved."""

    before: SetState
    after: SetState
    names: tuple[str, ...]
    run: bool = False
    notes: tuple[str, ...] = ()

    @property
    def undo_patch(self) -> UndoPatch:
        """What undoes it."""
        return UndoPatch(self.names, _select(self.before.saved, self.names), _select(self.before.run, self.names))


def plan_set(state: SetState, asked: SetParameters) -> Change:
    """All values of a request or none: raises BadInput that names every violation, MOST_FAULTS of them at most.

    A value that is set takes effect at once. Where the command line has one, which would win, it also counts for
    this run, and the note says so.
    """
    if not state.schema.parameters:
        raise BadInput(not_announced_text(state))
    where = state.name
    faults: list[str] = []
    notes: list[str] = []
    fitted: Layer = {}
    for place, each in enumerate(asked.values):
        if len(faults) == MAX_VIOLATIONS:
            faults.append(f"{len(asked.values) - place} more values were not looked at")
            break
        try:
            described = state.schema.description(each.name, where)
            if each.name in fitted:
                raise BadInput(f"{each.name} is given twice")
            if not described.live:
                raise BadInput(
                    f"{each.name} cannot change while {_node_names(state)} runs: "
                    "set it in the fleet file or on the command line, and restart"
                )
            fitted[each.name], said = fit(described, each.value, asked.clamp)
            notes += said
        except BadInput as error:
            faults.append(str(error))
    if not asked.values:
        faults.append("no parameter is given")
    if faults:
        more = "; nothing was changed" if len(asked.values) > 1 else ""
        raise BadInput(f"{'; '.join(faults)}{more}")
    saved, run = dict(state.saved), dict(state.run)
    for name, value in fitted.items():
        if asked.run:
            run[name] = value
            continue
        saved[name] = value
        run.pop(name, None)
        if name in state.schema.command_line:
            run[name] = value
            given = format_value(state.schema.command_line[name])
            notes.append(f"{name}: the command line says {given}; this value counts for this run, and later without it")
    return _check_constraints(_make_change(state, saved, run, tuple(fitted), asked.run, notes))


def plan_reset(state: SetState, asked: ResetParameters) -> Change:
    """Forget what was set of some names, of all when none is given; raises BadInput for an unknown one, and where what
    counts then would contradict what stays set."""
    known = {*state.schema.parameters, *state.saved, *state.run}
    for name in asked.names:
        if name not in known:
            raise unknown_name("parameter", name, known, state.name)
    wanted = asked.names or tuple(dict.fromkeys((*state.saved, *state.run)))
    names = tuple(name for name in dict.fromkeys(wanted) if name in state.saved or name in state.run)
    saved = {name: value for name, value in state.saved.items() if name not in names}
    run = {name: value for name, value in state.run.items() if name not in names}
    for_run = bool(names) and not any(name in state.saved for name in names)
    return _check_constraints(_make_change(state, saved, run, names, for_run, [] if names else ["nothing was set"]))


def plan_undo(state: SetState, back: UndoPatch, for_run: bool) -> Change:
    """Put the layers back as they were; raises BadInput when a value fits no longer, or not with the others."""
    saved, run = dict(state.saved), dict(state.run)
    for name in back.names:
        for layer, old in ((saved, back.saved), (run, back.run)):
            layer.pop(name, None)
            if name not in old:
                continue
            layer[name] = old[name]
            described = state.schema.parameters.get(name)
            if described is not None:
                try:
                    layer[name] = fit(described, renamed_choice(old[name], described.choices) or old[name]).value
                except BadInput as error:
                    raise BadInput(f"the last change cannot be taken back, its schema has changed: {error}") from None
    return _check_constraints(_make_change(state, saved, run, back.names, for_run, []))


def plan_new_run(state: SetState) -> Change | None:
    """Forget what was for one run, at the start of the next; None when there is nothing."""
    if not state.run:
        return None
    names = tuple(state.run)
    return _make_change(
        state, dict(state.saved), {}, names, True, [f"a new run: {', '.join(names)} as before the last"]
    )


def not_announced_text(state: SetState) -> str:
    """Why nothing can be set."""
    kept = f" (saved values are kept for it: {', '.join(state.saved)})" if state.saved else ""
    return f"no running service has announced {state.name}{kept}: start it first"


def _check_constraints(change: Change) -> Change:
    """The change, unless what it touches contradicts something afterwards: raises BadInput."""
    after = change.after
    values = {name: each.value for name, each in after.effective_values().items()}
    found = violations(after.schema.parameters.values(), values, frozenset(change.names))
    if faults := list(islice(found, MAX_VIOLATIONS)):
        raise BadInput(f"{'; '.join(faults)}; nothing was changed")
    return change


def _make_change(
    state: SetState, saved: Layer, run: Layer, names: tuple[str, ...], for_run: bool, notes: list[str]
) -> Change:
    after = replace(state, saved=saved, run=run, revision=state.revision + (1 if names else 0))
    return Change(state, after, names, for_run, tuple(notes))


def _select(layer: Mapping[str, Value], names: tuple[str, ...]) -> Layer:
    return {name: layer[name] for name in names if name in layer}


def _node_names(state: SetState) -> str:
    return ", ".join(state.schema.announced)
