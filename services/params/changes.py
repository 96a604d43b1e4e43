"""Plans changes of a parameter set before they are applied: announcement, migration, set, reset, undo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import islice

from messages.parameters import Announcement, ParameterDescription, ResetParameters, SetParameters, Value
from services.params.schema import Schema, SetState, same_value
from services.params.value_check import fit, format_value, parse_type
from services.runtime.errors import BadInput, nearest, unknown_name
from services.runtime.parameters.schema import renamed_choice, violations

_MAX_HINTS = 10
"""Maximum unknown saved values for which a similar name is searched: each is compared with all names."""


@dataclass(frozen=True)
class Migration:
    """Saved values fitted to a schema.

    ``saved`` are the values after migration, ``names`` the parameters whose value changed, with a text for each in
    ``texts``; ``waiting`` has a text for each value of a parameter that no running node has.
    """

    saved: Mapping[str, Value]
    names: tuple[str, ...]
    texts: tuple[str, ...]
    waiting: tuple[str, ...]


def migrate(saved: Mapping[str, Value], schema: Schema) -> Migration:
    """Fit saved values to the schema.

    An int becomes a float, and a whole float an int; a renamed choice gets its new name. A value outside new bounds is
    dropped, not clamped, since nobody chose the bound. A value whose parameter no running node has is kept: its node
    may start later, and the value of a renamed parameter is not lost.
    """
    kept: dict[str, Value] = {}
    names: list[str] = []
    texts: list[str] = []
    waiting: list[str] = []
    for name, value in saved.items():
        described = schema.parameters.get(name)
        if described is None:
            kept[name] = value
            near = nearest(name, schema.parameters) if len(waiting) < _MAX_HINTS else []
            hint = f" (was it renamed to {near[0]}? then set that)" if near else ""
            waiting.append(
                f"{name} = {format_value(value)} is saved, but no running node has such a parameter{hint}: it is kept"
            )
            continue
        try:
            new = _fitted(described, value)
        except BadInput as error:
            names.append(name)
            texts.append(f"saved {name} = {format_value(value)} was dropped: {error}")
            continue
        kept[name] = new
        if not same_value(new, value):
            why = "the choice was renamed" if described.choices else f"its type is {described.type} now"
            names.append(name)
            texts.append(f"saved {name} = {format_value(value)} became {format_value(new)}: {why}")
    return Migration(kept, tuple(names), tuple(texts), tuple(waiting))


def _fitted(described: ParameterDescription, value: Value) -> Value:
    if not described.live:
        raise BadInput("it can now be set only in the fleet file or on the command line")
    if parse_type(described.type) == ("int", 0) and isinstance(value, float) and value.is_integer():
        value = int(value)
    return fit(described, renamed_choice(value, described.choices) or value).value


@dataclass(frozen=True)
class AnnounceResult:
    """The set after an announcement.

    ``migrated`` names the saved values that changed; ``warnings`` has a text for each changed or dropped value, and
    ``waiting`` for each saved value that no running node has. ``schema_changed`` and ``values_changed`` select the
    messages to publish.
    """

    state: SetState
    schema_changed: bool
    values_changed: bool
    migrated: tuple[str, ...]
    warnings: tuple[str, ...]
    waiting: tuple[str, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """All notes, for subscribers."""
        return (*self.warnings, *self.waiting)


def apply_announcement(before: SetState, joined: SetState, asked: Announcement) -> AnnounceResult:
    """Apply an announcement to the set ``before``; ``joined`` is the same set with the new schema."""
    joined = replace(joined, run={**_remembered_run_values(before, asked), **joined.run})
    migration = migrate(joined.saved, joined.schema)
    run, dropped = _fitting_run_values(joined)
    state = replace(joined, saved=migration.saved, run=run)
    new = asked.node not in before.schema.announced
    values_changed = new or bool(migration.names) or _differs(before, state)
    if values_changed:
        state = replace(state, revision=before.revision + 1)
    return AnnounceResult(
        state=state,
        schema_changed=new or before.schema.to_message(before.name) != state.schema.to_message(state.name),
        values_changed=values_changed,
        migrated=migration.names,
        warnings=(*migration.texts, *dropped),
        waiting=migration.waiting,
    )


def _remembered_run_values(before: SetState, asked: Announcement) -> dict[str, Value]:
    """Return the run values that a node kept over a restart of this service."""
    if asked.node in before.schema.announced:
        return {}
    live = {each.name for each in asked.parameters if each.live}
    return {each.name: each.value for each in asked.run if each.name in live}


def _fitting_run_values(state: SetState) -> tuple[dict[str, Value], list[str]]:
    """Return the run values that fit the schema, and a text for each that does not."""
    kept: dict[str, Value] = {}
    dropped = []
    for name, value in state.run.items():
        described = state.schema.parameters.get(name)
        try:
            kept[name] = value if described is None else fit(described, value).value
        except BadInput as error:
            dropped.append(f"a value of this run was dropped: {error}")
    return kept, dropped


def _differs(before: SetState, after: SetState) -> bool:
    old, new = before.effective_values(), after.effective_values()
    return old.keys() != new.keys() or any(
        not same_value(old[name].value, new[name].value) or old[name].origin != new[name].origin for name in old
    )


Layer = dict[str, Value]

MAX_VIOLATIONS = 10
"""Maximum violations listed in one refusal."""


@dataclass(frozen=True)
class UndoPatch:
    """The patch of an undo: the layers of the parameters ``names`` before the change. A missing name was not set."""

    names: tuple[str, ...]
    saved: Mapping[str, Value]
    run: Mapping[str, Value]


@dataclass(frozen=True)
class Change:
    """A set before and after a change of the parameters ``names``. ``run`` means that it changes no saved value."""

    before: SetState
    after: SetState
    names: tuple[str, ...]
    run: bool = False
    notes: tuple[str, ...] = ()

    @property
    def undo_patch(self) -> UndoPatch:
        """The patch that undoes it."""
        return UndoPatch(self.names, _select(self.before.saved, self.names), _select(self.before.run, self.names))


def plan_set(state: SetState, asked: SetParameters) -> Change:
    """Plan to set all values of a request or none; raises BadInput that lists up to MAX_VIOLATIONS violations.

    A value takes effect at once. If the command line has another value, which would take precedence, the new one is
    also set for this run, with a note.
    """
    if not state.schema.parameters:
        raise BadInput(not_announced_text(state))
    where = state.name
    faults: list[str] = []
    notes: list[str] = []
    fitted: Layer = {}
    for place, each in enumerate(asked.values):
        if len(faults) == MAX_VIOLATIONS:
            faults.append(f"{len(asked.values) - place} more values were not checked")
            break
        try:
            described = state.schema.description(each.name, where)
            if each.name in fitted:
                raise BadInput(f"{each.name} is given twice")
            if not described.live:
                raise BadInput(
                    f"{each.name} cannot change while {', '.join(state.schema.announced)} runs: "
                    "set it in the fleet file or on the command line, and restart"
                )
            fitted[each.name], fit_notes = fit(described, each.value, asked.clamp)
            notes += fit_notes
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
            notes.append(
                f"{name}: the command line gives {given}; the new value is used for this run, and in later ones "
                "without that option"
            )
    return _check_constraints(_make_change(state, saved, run, tuple(fitted), asked.run, notes))


def plan_reset(state: SetState, asked: ResetParameters) -> Change:
    """Plan to reset the given parameters, or all of them.

    Raises BadInput for an unknown name, and if the resulting values would violate a constraint.
    """
    known = {*state.schema.parameters, *state.saved, *state.run}
    for name in asked.names:
        if name not in known:
            raise unknown_name("parameter", name, known, state.name)
    requested = asked.names or tuple(dict.fromkeys((*state.saved, *state.run)))
    names = tuple(name for name in dict.fromkeys(requested) if name in state.saved or name in state.run)
    saved = {name: value for name, value in state.saved.items() if name not in names}
    run = {name: value for name, value in state.run.items() if name not in names}
    for_run = bool(names) and not any(name in state.saved for name in names)
    return _check_constraints(_make_change(state, saved, run, names, for_run, [] if names else ["nothing was set"]))


def plan_undo(state: SetState, back: UndoPatch, for_run: bool) -> Change:
    """Plan to restore the layers before a change; raises BadInput if a value no longer fits, alone or with others."""
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
                    raise BadInput(f"the last change cannot be undone, its schema has changed: {error}") from None
    return _check_constraints(_make_change(state, saved, run, back.names, for_run, []))


def plan_new_run(state: SetState) -> Change | None:
    """Plan to drop the run values at the start of the next run; returns None if there are none."""
    if not state.run:
        return None
    names = tuple(state.run)
    note = f"a new run: the last one's own values of {', '.join(names)} are dropped"
    return _make_change(state, dict(state.saved), {}, names, True, [note])


def not_announced_text(state: SetState) -> str:
    """Return the error text for setting a parameter in a set that no node has announced."""
    kept = f" (saved values are kept for it: {', '.join(state.saved)})" if state.saved else ""
    return f"no running service has announced {state.name}{kept}: start it first"


def _check_constraints(change: Change) -> Change:
    """Return the change; raises BadInput if a parameter that it changes would violate a constraint."""
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
