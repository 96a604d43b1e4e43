"""The panel's connection to the bus: subscribes to the topics on pages and publishes their commands; in the loop."""

from __future__ import annotations

from services.panel import PanelParameters
from services.panel.channels import (
    FleetChannel,
    LogChannel,
    ParameterSetsChannel,
    ParameterValuesChannel,
    PosesChannel,
    RobotsChannel,
)
from services.panel.clock import ClockChannel, SimTimeMap
from services.panel.drive import DriveController, GoalPublisher
from services.panel.estop import EmergencyStopClient
from services.panel.graph import GraphChannel, NodeGraph, RatesChannel
from services.panel.markers import MarkersChannel, MarkerTracker
from services.panel.pages import Disconnected, Page, PageRegistry, send_error, send_reply
from services.panel.plots import Plots
from services.panel.protocol import (
    ClientMessage,
    ClientRequest,
    Drive,
    Estop,
    Goal,
    PageChannel,
    Release,
    Subscribe,
    as_json,
)
from services.panel.requests import RequestClient
from services.panel.robots import RobotTracker
from services.panel.subscriptions import SharedSubscriptions
from services.panel.world import BodiesChannel, ScanSender, WorldChannel, WorldTracker
from services.runtime.errors import BadInput
from services.runtime.node import Node

STATUS_PERIOD_S = 1.0
"""Wall time [s] between two status messages to a page."""


class Hub:
    """Connects pages and nodes. ``time`` is simulation time. ``update`` is called about 25 times a second while pages
    are open, else about ten times."""

    def __init__(self, node: Node, pages: PageRegistry, params: PanelParameters) -> None:
        self.time = SimTimeMap()
        self._pages, self._requests = pages, RequestClient(node.transport, node.identity)
        self._subscriptions, self._graph = SharedSubscriptions(node), NodeGraph(node.transport)
        subscriptions, graph = self._subscriptions, self._graph
        self._robots = RobotTracker(subscriptions, graph)
        self._stops, self._goals = EmergencyStopClient(node, self._robots), GoalPublisher(node, self._robots)
        self.drive_controller = DriveController(node, self._robots, params)
        self._plots = Plots(subscriptions, graph, self.time)
        self._log, self._world = LogChannel(subscriptions), WorldTracker(subscriptions)
        self._markers = MarkerTracker(subscriptions, graph, self._robots, self.time)
        self._scans = ScanSender(subscriptions, graph, self._robots)
        self._channels: dict[str, PageChannel] = {
            "clock": ClockChannel(subscriptions, self.time),
            "fleet": FleetChannel(subscriptions, graph),
            "graph": GraphChannel(graph),
            "rates": RatesChannel(subscriptions, graph, self.time),
            "log": self._log,
            "poses": PosesChannel(self._robots),
            "robots": RobotsChannel(self._robots, self._stops),
            "sets": ParameterSetsChannel(subscriptions, graph),
            "values": ParameterValuesChannel(subscriptions, graph),
            "world": WorldChannel(self._world),
            "bodies": BodiesChannel(self._world),
            "markers": MarkersChannel(self._markers),
        }
        self._wanted: dict[Page, frozenset[str]] = {}
        self._sent: dict[tuple[Page, str], tuple[int, float]] = {}
        self._enabled: frozenset[str] = frozenset()
        self._due = 0.0

    @property
    def period(self) -> float:
        """Wall time to the next turn [s]: short while a page drives, long without pages."""
        if self.drive_controller.busy or self._requests.busy:
            return 0.02
        return 0.04 if self._wanted else 1.0

    def update(self, now: float) -> None:
        """Read all inputs, then update the pages; ``now`` is wall time [s]."""
        self._graph.update()
        self._subscriptions.update()
        self._log.update(now)
        self._robots.update()
        self._world.update()
        self._markers.update(now)
        self._stops.update()
        self._goals.close_unused()
        for name, channel in self._channels.items():  # the clock first: the others use its time
            if name in self._enabled and name != "log":
                channel.update(now)
        for page, message in self._pages.drain():
            self._handle(page, message, now)
        self._enable_channels()
        self._requests.poll()
        self.drive_controller.update(now, self.time.now, self.time.epoch)
        self._plots.update(now)
        self._scans.update(now)
        self._publish(now)

    def _handle(self, page: Page, message: ClientMessage | Disconnected, now: float) -> None:
        try:
            match message:
                case Disconnected():
                    self._disconnect(page)
                case Subscribe():
                    self._wanted[page] = frozenset((*message.channels, "clock"))
                    self._plots.set_subscription(page, message)
                    self._scans.set_subscription(page, message.scan)
                case Drive():
                    self.drive_controller.drive(page, message, now)
                case Release():
                    self.drive_controller.release(page)
                case Goal():
                    send_reply(page, message.id, True, self._goals.send(message, self.time.now))
                case Estop():
                    send_reply(page, message.id, True, self._stops.set_stop(message.robot, message.on))
                case ClientRequest():
                    self._requests.send(page, message, self.drive_controller.params.deadline)
        except BadInput as error:
            if isinstance(message, ClientRequest):
                send_reply(page, message.id, False, str(error))
            else:
                send_error(page, str(error))

    def _disconnect(self, page: Page) -> None:
        self.drive_controller.release(page)
        self._wanted.pop(page, None)
        self._plots.set_subscription(page, None)
        self._scans.set_subscription(page, "")
        self._sent = {place: sent for place, sent in self._sent.items() if place[0] is not page}

    def _enable_channels(self) -> None:
        """Enable the channels that any page shows, disable the others. Driving, and the lifetimes of markers, need the
        clock even without a page."""
        timed = self.drive_controller.busy or self._markers.subscribed
        wanted = frozenset[str]({"clock"} if timed else ()).union(*self._wanted.values())
        if wanted == self._enabled:
            return
        self._robots.set_enabled("poses" in wanted, "robots" in wanted)
        for name, channel in self._channels.items():
            if (name in wanted) != (name in self._enabled):
                channel.set_enabled(name in wanted)
        self._enabled = wanted

    def _publish(self, now: float) -> None:
        """Send each page what is new to it and due."""
        about = now >= self._due
        self._due = now + STATUS_PERIOD_S if about else self._due
        made: dict[tuple[str, int], str | None] = {}
        for page, names in self._wanted.items():
            for name in names:
                self._publish_channel(page, name, now, made)
            if about:
                counts = {"dropped": page.dropped, "refused": page.rejected, "pages": len(self._wanted)}
                limits = {"v": self.drive_controller.params.max_linear, "w": self.drive_controller.params.max_angular}
                page.set_state("about", as_json("about", limits=limits, **counts))
            page.flush()

    def _publish_channel(self, page: Page, name: str, now: float, made: dict[tuple[str, int], str | None]) -> None:
        channel = self._channels[name]
        since, at = self._sent.get((page, name), (-1, -1e9))
        if channel.version == since or now - at < channel.period * 0.9:
            return
        self._sent[page, name] = channel.version, now
        key = name, since if channel.streams else 0
        if key not in made:
            made[key] = channel.delta(since)
        delta = made[key]
        if delta is not None:
            page.enqueue(delta) if channel.streams else page.set_state(name, delta)
