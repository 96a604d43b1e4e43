"""Samples for plots: every wished field of every message, with its simulation time."""

from __future__ import annotations

from services.panel.channel import as_json
from services.panel.feeds import Feeds, Hold
from services.panel.fields import leaves, number, parse, stamp
from services.panel.frame import Samples, pack
from services.panel.network import Network
from services.panel.page import Page
from services.panel.sim_time import SimTime
from services.panel.units import unit
from services.panel.words import Want

LIST_PERIOD_S = 0.4
"""Wall time between two lists of a topic's fields."""

Place = tuple[str, str]


class Plots:
    """Reads the topics that pages wish for, once each; a topic that is not there yet is taken up when it comes."""

    def __init__(self, feeds: Feeds, network: Network, time: SimTime) -> None:
        self._hold, self._network, self._time = Hold(feeds), network, time
        self._wants: dict[Page, Want] = {}
        self._newest: dict[str, object] = {}
        self._due = 0.0
        self._followed: tuple[int, int] = (-1, -1)
        self._changes = 0
        self._samples: dict[tuple[str, str], Samples] = {}
        self._steps: dict[str, dict[str, tuple[str | int, ...]]] = {}
        self._units: dict[tuple[str, str], str] = {}
        self._told_units: dict[Page, dict[int, str]] = {}

    @property
    def busy(self) -> bool:
        """Whether anybody wants samples."""
        return any(want.series or want.fields for want in self._wants.values())

    def want(self, page: Page, want: Want | None) -> None:
        """What a page wishes for from now on; None when it is gone."""
        if want is None:
            self._wants.pop(page, None)
            self._told_units.pop(page, None)
        else:
            self._wants[page] = want
        self._changes += 1

    def turn(self, now: float) -> None:
        """Take in what has come, and give it to the pages."""
        if self._followed != (self._network.version, self._changes):
            self._followed = self._network.version, self._changes
            self._reconcile()
        self._collect()
        self._give()
        if now >= self._due:
            self._due = now + LIST_PERIOD_S
            self._list()

    def _reconcile(self) -> None:
        """Hold what is wished and there."""
        self._steps = {}
        names: set[str] = set()
        for want in self._wants.values():
            names.update(want.fields)
            for wish in want.series:
                names.add(wish.topic)
                self._steps.setdefault(wish.topic, {})[wish.path] = parse(wish.path)
        wanted: dict[Place, str] = {}
        for name in sorted(names):
            entity = self._network.published(name)
            if entity is not None:
                wanted[name, entity.record] = entity.detail
        self._hold.want(wanted)
        self._newest = {name: message for name, message in self._newest.items() if name in names}
        self._units = {
            place: known for place, known in self._units.items() if place[1] in self._steps.get(place[0], ())
        }

    def _collect(self) -> None:
        self._samples = {}
        for name, record in self._hold.places():
            batch = self._hold.batch(name, record)
            if not batch:
                continue
            self._newest[name] = batch[-1][0]
            paths = self._steps.get(name)
            if not paths:
                continue
            for path, steps in paths.items():
                if (name, path) not in self._units:
                    self._units[name, path] = unit(name, batch[-1][0], steps)
            lists = [(self._samples.setdefault((name, path), Samples()), steps) for path, steps in paths.items()]
            for message, origin in batch:
                told = stamp(message)
                time = (self._time.at(origin) if told is None else told) / 1e9
                for samples, steps in lists:
                    value = number(message, steps)
                    if value is not None:
                        samples.add(time, value)

    def _give(self) -> None:
        bodies = {place: (len(samples), samples.body()) for place, samples in self._samples.items() if len(samples)}
        if not bodies:
            return
        for page, want in self._wants.items():
            series = [
                (wish.id, *bodies[wish.topic, wish.path]) for wish in want.series if (wish.topic, wish.path) in bodies
            ]
            if series:
                page.stream(pack(self._time.era, series))

    def _list(self) -> None:
        """Tell each page what is in the topics that it looks into."""
        listed: dict[str, str] = {}
        for page, want in self._wants.items():
            units = {
                wish.id: known
                for wish in want.series
                if (known := self._units.get((wish.topic, wish.path))) is not None
            }
            if units and self._told_units.get(page) != units:
                self._told_units[page] = units
                page.tell("units", as_json("units", units=units))
            for name in want.fields:
                if name not in listed:
                    entity, message = self._network.published(name), self._newest.get(name)
                    listed[name] = as_json(
                        "fields",
                        topic=name,
                        type=entity.record if entity else "",
                        fields=leaves(message) if message is not None else None,
                    )
                page.tell(f"fields {name}", listed[name])
