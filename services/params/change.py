"""Changes of a set, planned whole before any of it is applied: set, reset, undo, and what the end of a run forgets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import islice

from messages.parameters import ResetParameters, SetParameters, Value
from services.params.check import fit, shown
from services.params.state import State
from services.runtime.errors import BadInput, unknown
from services.runtime.parameters.allowed import contradictions

Layer = dict[str, Value]

MOST_FAULTS = 10
"""Violations that one refusal names."""


@dataclass(frozen=True)
class Back:
    """What an undo restores: the layers of the parameters ``names`` before the change; a name missing was not set."""

    names: tuple[str, ...]
    saved: Mapping[str, Value]
    run: Mapping[str, Value]


@dataclass(frozen=True)
class Change:
    """A set before and after, and what to say of it. ``run`` tells that nothing of it is saved."""

    before: State
    after: State
    names: tuple[str, ...]
    run: bool = False
    notes: tuple[str, ...] = ()

    @property
    def back(self) -> Back:
        """What undoes it."""
        return Back(self.names, _part(self.before.saved, self.names), _part(self.before.run, self.names))


def plan_set(state: State, asked: SetParameters) -> Change:
    """All values of a request or none: raises BadInput that names every violation, MOST_FAULTS of them at most.

    A value that is set takes effect at once. Where the command line has one, which would win, it also counts for
    this run, and the note says so.
    """
    if not state.schema.parameters:
        raise BadInput(unannounced(state))
    where = state.name
    faults: list[str] = []
    notes: list[str] = []
    fitted: Layer = {}
    for place, each in enumerate(asked.values):
        if len(faults) == MOST_FAULTS:
            faults.append(f"{len(asked.values) - place} more values were not looked at")
            break
        try:
            described = state.schema.description(each.name, where)
            if each.name in fitted:
                raise BadInput(f"{each.name} is given twice")
            if not described.live:
                raise BadInput(
                    f"{each.name} cannot change while {_nodes(state)} runs: "
                    "say it in the fleet file or on the command line, and start anew"
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
            given = shown(state.schema.command_line[name])
            notes.append(f"{name}: the command line says {given}; this value counts for this run, and later without it")
    return _agreeing(_changed(state, saved, run, tuple(fitted), asked.run, notes))


def plan_reset(state: State, asked: ResetParameters) -> Change:
    """Forget what was set of some names, of all when none is given; raises BadInput for an unknown one, and where what
    counts then would contradict what stays set."""
    known = {*state.schema.parameters, *state.saved, *state.run}
    for name in asked.names:
        if name not in known:
            raise unknown("parameter", name, known, state.name)
    wanted = asked.names or tuple(dict.fromkeys((*state.saved, *state.run)))
    names = tuple(name for name in dict.fromkeys(wanted) if name in state.saved or name in state.run)
    saved = {name: value for name, value in state.saved.items() if name not in names}
    run = {name: value for name, value in state.run.items() if name not in names}
    for_run = bool(names) and not any(name in state.saved for name in names)
    return _agreeing(_changed(state, saved, run, names, for_run, [] if names else ["nothing was set"]))


def plan_undo(state: State, back: Back, for_run: bool) -> Change:
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
                    layer[name] = fit(described, old[name]).value
                except BadInput as error:
                    raise BadInput(f"the last change cannot be taken back, its schema has changed: {error}") from None
    return _agreeing(_changed(state, saved, run, back.names, for_run, []))


def plan_new_run(state: State) -> Change | None:
    """Forget what was for one run, at the start of the next; None when there is nothing."""
    if not state.run:
        return None
    names = tuple(state.run)
    return _changed(state, dict(state.saved), {}, names, True, [f"a new run: {', '.join(names)} as before the last"])


def unannounced(state: State) -> str:
    """Why nothing can be set."""
    kept = f" (saved values are kept for it: {', '.join(state.saved)})" if state.saved else ""
    return f"no running service has announced {state.name}{kept}: start it first"


def _agreeing(change: Change) -> Change:
    """The change, unless what it touches contradicts something afterwards: raises BadInput."""
    after = change.after
    values = {name: each.value for name, each in after.values().items()}
    found = contradictions(after.schema.parameters.values(), values, frozenset(change.names))
    if faults := list(islice(found, MOST_FAULTS)):
        raise BadInput(f"{'; '.join(faults)}; nothing was changed")
    return change


def _changed(state: State, saved: Layer, run: Layer, names: tuple[str, ...], for_run: bool, notes: list[str]) -> Change:
    after = replace(state, saved=saved, run=run, revision=state.revision + (1 if names else 0))
    return Change(state, after, names, for_run, tuple(notes))


def _part(layer: Mapping[str, Value], names: tuple[str, ...]) -> Layer:
    return {name: layer[name] for name in names if name in layer}


def _nodes(state: State) -> str:
    return ", ".join(state.schema.announced)
