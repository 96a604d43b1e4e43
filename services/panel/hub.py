"""The panel's side of the bus: follows what pages want, and sends what they say; all in the loop's thread."""

from __future__ import annotations

from services.panel import PanelParameters
from services.panel.answers import answer, tell_error
from services.panel.asks import Asker
from services.panel.board import Board, Gone
from services.panel.channel import Channel, as_json
from services.panel.clock import ClockChannel
from services.panel.drive import Driver
from services.panel.estop import Stops
from services.panel.feeds import Feeds
from services.panel.fleet import FleetChannel
from services.panel.goals import Goals
from services.panel.graph import GraphChannel, RatesChannel
from services.panel.log_lines import LogChannel
from services.panel.map import PosesChannel, RobotsChannel
from services.panel.network import Network
from services.panel.page import Page
from services.panel.plots import Plots
from services.panel.robots import Robots
from services.panel.sets import SetsChannel, ValuesChannel
from services.panel.sim_time import SimTime
from services.panel.words import Ask, Drive, Estop, Goal, Release, Said, Want
from services.runtime.errors import BadInput
from services.runtime.node import Node

HEALTH_PERIOD_S = 1.0
"""Wall time between two words to a page about itself."""


class Hub:
    """``time`` is the simulation's. ``turn`` is called some 25 times a second while pages are open, else ten."""

    def __init__(self, node: Node, board: Board, params: PanelParameters) -> None:
        self.time = SimTime()
        self._board, self._asker = board, Asker(node.transport, node.identity)
        self._feeds, self._network = Feeds(node), Network(node.transport)
        feeds, network = self._feeds, self._network
        self._robots = Robots(feeds, network)
        self._stops, self._goals = Stops(node, self._robots), Goals(node, self._robots)
        self.driver = Driver(node, self._robots, params)
        self._plots = Plots(feeds, network, self.time)
        self._log = LogChannel(feeds)
        self._channels: dict[str, Channel] = {
            "clock": ClockChannel(feeds, self.time),
            "fleet": FleetChannel(feeds, network),
            "graph": GraphChannel(network),
            "rates": RatesChannel(feeds, network, self.time),
            "log": self._log,
            "poses": PosesChannel(self._robots),
            "robots": RobotsChannel(self._robots, self._stops),
            "sets": SetsChannel(feeds, network),
            "values": ValuesChannel(feeds, network),
        }
        self._wants: dict[Page, frozenset[str]] = {}
        self._told: dict[tuple[Page, str], tuple[int, float]] = {}
        self._followed: frozenset[str] = frozenset()
        self._due = 0.0

    @property
    def period(self) -> float:
        """Wall time to the next turn [s]: short while somebody drives, long when nobody looks."""
        if self.driver.busy or self._asker.busy:
            return 0.02
        return 0.04 if self._wants else 1.0

    def turn(self, now: float) -> None:
        """Take in everything, then tell the pages; ``now`` is wall time [s]."""
        self._network.turn()
        self._feeds.admit()
        self._log.turn(now)
        self._robots.turn()
        self._stops.turn()
        self._goals.forget_gone()
        for name, channel in self._channels.items():  # the clock first: the others count by it
            if name in self._followed and name != "log":
                channel.turn(now)
        for page, said in self._board.heard():
            self._hear(page, said, now)
        self._follow()
        self._asker.turn()
        self.driver.turn(now, self.time.now, self.time.era)
        self._plots.turn(now)
        self._tell(now)

    def _hear(self, page: Page, said: Said | Gone, now: float) -> None:
        try:
            match said:
                case Gone():
                    self._forget(page)
                case Want():
                    self._wants[page] = frozenset((*said.channels, "clock"))
                    self._plots.want(page, said)
                case Drive():
                    self.driver.drive(page, said, now)
                case Release():
                    self.driver.release(page)
                case Goal():
                    answer(page, said.id, True, self._goals.send(said, self.time.now))
                case Estop():
                    answer(page, said.id, True, self._stops.order(said.robot, said.on))
                case Ask():
                    self._asker.ask(page, said, self.driver.params.deadline)
        except BadInput as error:
            if isinstance(said, Ask):
                answer(page, said.id, False, str(error))
            else:
                tell_error(page, str(error))

    def _forget(self, page: Page) -> None:
        self.driver.release(page)
        self._wants.pop(page, None)
        self._plots.want(page, None)
        self._told = {place: told for place, told in self._told.items() if place[0] is not page}

    def _follow(self) -> None:
        """Open the channels that any page wants, close the others. Who drives needs the time, page or not."""
        wanted = frozenset[str]({"clock"} if self.driver.busy else ()).union(*self._wants.values())
        if wanted == self._followed:
            return
        self._robots.follow("poses" in wanted, "robots" in wanted)
        for name, channel in self._channels.items():
            if (name in wanted) != (name in self._followed):
                channel.follow(name in wanted)
        self._followed = wanted

    def _tell(self, now: float) -> None:
        """Give each page what is new to it and due."""
        about = now >= self._due
        self._due = now + HEALTH_PERIOD_S if about else self._due
        made: dict[tuple[str, int], str | None] = {}
        for page, names in self._wants.items():
            for name in names:
                self._tell_one(page, name, now, made)
            if about:
                counts = {"dropped": page.dropped, "refused": page.refused, "pages": len(self._wants)}
                limits = {"v": self.driver.params.max_linear, "w": self.driver.params.max_angular}
                page.tell("about", as_json("about", limits=limits, **counts))
            page.flush()

    def _tell_one(self, page: Page, name: str, now: float, made: dict[tuple[str, int], str | None]) -> None:
        channel = self._channels[name]
        since, at = self._told.get((page, name), (-1, -1e9))
        if channel.version == since or now - at < channel.period * 0.9:
            return
        self._told[page, name] = channel.version, now
        key = name, since if channel.streams else 0
        if key not in made:
            made[key] = channel.news(since)
        news = made[key]
        if news is not None:
            page.stream(news) if channel.streams else page.tell(name, news)
