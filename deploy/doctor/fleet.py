"""Checks the running fleets: processes, orphans, disk, refused commands, and publishers that are too fast."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from deploy.doctor import Finding, fail, ok, warn
from deploy.doctor.machine import disk_space
from deploy.interfaces import known_topic
from messages.base import WrongPayload, decoder
from messages.elea import BaseStatus, FleetState, Health
from messages.rosgraph import Clock
from messages.topics import HEALTH
from services.runtime.fleet_instances import running_fleets
from services.runtime.graph import ALL_PINGS, ASKS_HEALTH, Entity
from services.runtime.transport.api import PendingReplies, Reply, Transport

OBSERVATION_S = 2.0
"""Maximum wall time for observing topics: until all nodes and bases have reported their state."""
MIN_OBSERVATION_S = 0.3
"""Minimum wall time for observing topics."""
MIN_SAMPLES = 10
"""Minimum number of samples for judging a rate."""
FAST_FACTOR, FLOOD_FACTOR = 3.0, 20.0
"""Multiples of the promised rate from which a publisher is reported, as a warning and as a failure."""
STALE_SHARE, MIN_STALE = 0.05, 5
"""Share and number of stale commands above which a base is reported."""

SHARE_S, BUSY_PERCENT = 0.1, 85.0
"""Minimum wall time for measuring a subscriber's share of a core, and the share [%] from which it is too slow."""
OVERLOAD = 1.5
"""Runnable processes per core above which the machine is overloaded."""

_ON_DEMAND = ("camera/image", "camera/camera_info", "/gazebo/model_states", "/gazebo/link_states", "cmd_vel_out")
"""Topics published only with subscribers: observing them would burden the fleet."""


class Sender(NamedTuple):
    """The publisher of a topic: its node, or ``a foreign program`` without a name."""

    node: str
    topic: str


@dataclass
class SampleCount:
    """Samples of one publisher: the first and last sequence number, and the number received; foreign ones have no
    numbers.
    """

    first: int = 0
    last: int = 0
    received: int = 0

    @property
    def sent(self) -> int:
        """The number of messages sent during the observation, including lost ones."""
        return max(self.last - self.first, self.received - 1)


class ProcessorUsage:
    """Measures the share of a core that processes use, from ``watch`` to ``percent``."""

    def __init__(self) -> None:
        self._first: dict[int, tuple[float, float]] = {}

    def watch(self, pids: Collection[int]) -> None:
        """Start measuring processes that are new."""
        for pid in pids:
            if pid not in self._first and (used := _processor_seconds(pid)) is not None:
                self._first[pid] = time.monotonic(), used

    def percent(self, pid: int) -> float:
        """Return the share of a core [%]; 0 for a process on another machine, or one that is gone or not measured long
        enough.
        """
        began, before = self._first.get(pid, (0.0, 0.0))
        now, used = time.monotonic(), _processor_seconds(pid)
        if not began or used is None or now - began < SHARE_S:
            return 0.0
        return 100 * (used - before) / (now - began)


def _processor_seconds(pid: int) -> float | None:
    import psutil

    try:
        times = psutil.Process(pid).cpu_times()
    except (psutil.Error, ValueError):
        return None
    return float(times.user + times.system)


@dataclass
class FleetObservation:
    """Observations of a running fleet over ``wall`` seconds; ``simulated`` is 0 if no simulation time passed."""

    wall: float = 0.0
    simulated: float = 0.0
    state: FleetState | None = None
    bases: dict[str, BaseStatus] = field(default_factory=dict)
    counts: dict[Sender, SampleCount] = field(default_factory=dict)
    heartbeats: dict[str, Health] = field(default_factory=dict)
    usage: ProcessorUsage = field(default_factory=ProcessorUsage)

    def rate(self, sender: Sender) -> float:
        """Return the rate of a publisher [Hz of simulation time]; 0 if no time passed, or it sent too few messages."""
        counted = self.counts.get(sender, SampleCount())
        return counted.sent / self.simulated if self.simulated > 0 and counted.sent >= MIN_SAMPLES else 0.0


def check_fleet(entities: Sequence[Entity], seen: FleetObservation) -> Iterator[Finding]:
    """Yield the problems of an observed fleet."""
    yield from processes(seen.state)
    yield from commands(seen.bases, entities)
    yield from rates(seen)


def processes(state: FleetState | None) -> Iterator[Finding]:
    """Report processes that failed, stopped, or were restarted."""
    if state is None:
        return
    sound = True
    for each in state.processes:
        name, reason = f"process {each.name}", f": {each.reason}" if each.reason else ""
        if each.nodes:
            reason += f"; its nodes: {', '.join(each.nodes)}"
        look = f"see why: ./elea logs {each.name}"
        if each.state == "failed":
            sound = False
            yield fail(name, f"it has failed{reason}", f"{look}; then ./elea restart {each.name}")
        elif each.state in ("backing off", "stopped"):
            sound = False
            yield warn(name, f"it is {each.state}{reason}", look)
        elif each.restarts:
            sound = False
            yield warn(name, f"it was restarted {each.restarts} times{reason}", look)
    if sound:
        yield ok("fleet state", f"{state.fleet}: {len(state.processes)} processes, none failed or restarted")


def commands(bases: Mapping[str, BaseStatus], entities: Collection[Entity]) -> Iterator[Finding]:
    """Report bases whose commands arrive too late, or are refused, or that are stopped."""
    for robot, base in sorted(bases.items()):
        topic = f"{robot.rstrip('/')}/cmd_vel"
        senders = sorted({each.node for each in entities if each.kind == "pub" and each.name == topic})
        source = f"from {', '.join(senders)}" if senders else "from an undeclared publisher"
        offered = base.commands + base.stale_dropped
        if base.stale_dropped >= MIN_STALE and base.stale_dropped > STALE_SHARE * offered:
            yield warn(
                f"base {robot}",
                f"{base.stale_dropped} of {offered} commands {source} were too old on arrival, and ignored",
                "the sender stalls, its link buffers, or its clock was set: restart the sender if this continues",
            )
        if base.refused:
            yield warn(
                f"base {robot}",
                f"{base.refused} commands {source} were refused: not finite, too fast, or one of several senders",
                f"see the messages: ./elea topic echo {topic}",
            )
        if base.e_stopped:
            yield warn(f"base {robot}", "an emergency stop holds it", "reset the stop where it was given")


def rates(seen: FleetObservation) -> Iterator[Finding]:
    """Report publishers far above the promised rate of their topic."""
    judged, sound = 0, True
    for node, name in sorted(seen.counts):
        topic, rate = known_topic(name), seen.rate(Sender(node, name))
        if topic is None or not topic.rate or not rate:
            continue
        judged += 1
        if rate > FAST_FACTOR * topic.rate:
            sound = False
            finding = fail if rate > FLOOD_FACTOR * topic.rate else warn
            yield finding(
                f"node {node}",
                f"it sends {name} at {rate:.0f} Hz of simulation time, {rate / topic.rate:.0f} times the promised "
                f"{topic.rate:g} Hz",
                "limit the rate of its loop, or stop it: its subscribers lose messages and other nodes are delayed",
            )
    if judged and sound:
        yield ok("rates", f"{judged} publications, none far above its promised rate")


def why_lost(name: str, beat: Health, seen: FleetObservation) -> str:
    """Return the most likely cause of lost messages of a topic, and the remedy."""
    topic = known_topic(name)
    for sender in sorted(seen.counts):
        rate = seen.rate(sender)
        if sender.topic == name and topic is not None and topic.rate and rate > FAST_FACTOR * topic.rate:
            return f"{sender.node} floods it with {rate:.0f} Hz, {topic.rate:g} are promised: slow it down or stop it"
    share = seen.usage.percent(beat.pid)
    if share > BUSY_PERCENT:
        return f"{beat.node} uses {share:.0f} % of a core and reads too slowly: reduce its work or its subscriptions"
    cores, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    if load > OVERLOAD * cores:
        return f"{load:.1f} runnable processes on {cores} cores: stop other programs on this machine"
    return "no cause is visible now: a link broke or a process was suspended; see whether the count grows"


def disk(fleet: str, folder: str) -> Iterator[Finding]:
    """Check that the disk to which the running fleet records has free space."""
    path = Path(folder)
    try:
        free = shutil.disk_usage(path).free
    except OSError as error:
        yield fail(
            f"disk of {fleet}",
            f"{path} cannot be checked: {error.strerror}",
            "check the disk: the run's results may be lost",
        )
        return
    yield disk_space(f"disk of {fleet}", path, free)


def observe_fleet(link: Transport, entities: Sequence[Entity], seconds: float = OBSERVATION_S) -> FleetObservation:
    """Observe the fleet until each node has reported its health and each base its state, at most for ``seconds``.

    The default is enough for a busy fleet as well. Of the topics, only those are observed that could be published too
    fast: the simulation's own follow from its ticks, and reading them all would cost a large fleet more than its robots
    do. A topic on which a node receives a program without sequence numbers is added once the node's heartbeat reports
    that.
    """
    from messages.names import key as key_of
    from messages.topics import BASE_STATUS, CLOCK, FLEET_STATE
    from services.runtime.subscriber import Subscriber, UntypedSubscriber
    from services.runtime.transport.wire import publisher_id

    nodes = {
        publisher_id(each.node, each.session, key_of(each.name)): each.node for each in entities if each.kind == "pub"
    }
    clock = UntypedSubscriber(link, CLOCK.name)
    fleet = UntypedSubscriber(link, FLEET_STATE.name, latched=True)
    health = Subscriber(HEALTH, HEALTH.name, key_of(HEALTH.name), link)
    listeners = {name: UntypedSubscriber(link, name) for name in _observable_topics(entities)}
    silent_bases = {name for name in listeners if name.endswith(f"/{BASE_STATUS.name}")}
    read_clock, read_base, read_fleet = decoder(Clock), decoder(BaseStatus), decoder(FleetState)
    seen, times, expected, least = FleetObservation(), [], set(nodes_with_loop(entities)), MIN_OBSERVATION_S
    asked: PendingReplies | None = link.query_async(ALL_PINGS, ASKS_HEALTH, seconds, notify=link.wake)
    began = time.monotonic()
    while (seen_for := time.monotonic() - began) < (
        seconds if silent_bases or expected - seen.heartbeats.keys() else least
    ):
        link.wait(clock.raw)
        for name, each in listeners.items():
            for sample in each.drain():
                node = "a foreign program" if sample.origin is None else nodes.get(sample.origin.publisher, "")
                counted = seen.counts.setdefault(Sender(node or "an undeclared publisher", name), SampleCount())
                counted.received += 1
                if sample.origin is not None:
                    counted.first = counted.first or sample.origin.sequence
                    counted.last = max(counted.last, sample.origin.sequence)
                if name.endswith(f"/{BASE_STATUS.name}"):
                    try:
                        seen.bases[name.removesuffix(f"/{BASE_STATUS.name}") or "/"] = read_base(sample.payload)
                    except WrongPayload:
                        continue
                    silent_bases.discard(name)
        for sample in clock.drain():
            try:
                times.append(read_clock(sample.payload).clock.ns)
            except WrongPayload:
                continue
        for sample in fleet.drain():
            try:
                seen.state = read_fleet(sample.payload)
            except WrongPayload:
                continue
            seen.usage.watch([each.pid for each in seen.state.processes])
        health.update()
        beats = [beat for beat, _ in health.messages]
        if asked is not None and (replies := asked.poll()) is not None:
            asked = None
            beats += _healths(replies)
        for beat in beats:
            seen.heartbeats[beat.node] = beat
            seen.usage.watch([beat.pid])
            for name in (entry.topic for entry in beat.inputs if entry.foreign):
                if name not in listeners and _is_observable(name):
                    listeners[name] = UntypedSubscriber(link, name)
                    least = seconds
    seen.wall = seen_for
    seen.simulated = (max(times) - min(times)) / 1e9 if times else 0.0
    for each in (*listeners.values(), clock, fleet):
        each.close()
    health.close()
    return seen


def _healths(replies: Sequence[Reply]) -> Iterator[Health]:
    """Yield the valid answers of nodes to a health request."""
    read = decoder(Health)
    for each in replies:
        if each.ok and 0 < len(each.payload) <= HEALTH.largest:
            with suppress(WrongPayload):
                yield read(each.payload)


def nodes_with_loop(entities: Sequence[Entity]) -> list[str]:
    """Return the nodes with a loop, except those of tools, whose names begin with an underscore."""
    names = {each.node for each in entities if each.kind == "node"}
    return sorted(each for each in names if not each.rpartition("/")[2].startswith("_"))


def _observable_topics(entities: Sequence[Entity]) -> list[str]:
    """Return the topics with a promised rate that nodes other than the simulation publish, and those of the bases."""
    from messages.topics import BASE_STATUS

    simulations = {each.node for each in entities if each.kind == "node" and each.name == "sim"}
    found = {each.name for each in entities if each.kind == "pub" and each.node not in simulations}
    found |= {each.name for each in entities if each.kind == "pub" and each.name.endswith(f"/{BASE_STATUS.name}")}
    return sorted(filter(_is_observable, found))


def _is_observable(name: str) -> bool:
    topic = known_topic(name)
    return topic is not None and bool(topic.rate) and topic.name not in _ON_DEMAND


INIT_PROCESSES = ("systemd", "init")
"""The processes that adopt orphans, besides process 1."""


def orphans() -> Iterator[Finding]:
    """Report services of this user that have neither a supervisor nor a terminal."""
    import psutil

    supervisors = {each.pid for each in running_fleets()}
    left, run = [], 0
    for process in psutil.process_iter(["pid", "cmdline", "uids"]):
        words = process.info["cmdline"] or []
        place = words.index("-m") if "-m" in words else len(words)
        uids = process.info["uids"]
        if words[place + 1 : place + 2] != ["services"] or uids is None or uids.real != os.getuid():
            continue
        try:
            line = process.parents()
            orphan = not line or line[0].pid == 1 or line[0].name() in INIT_PROCESSES
        except psutil.Error:
            continue
        run += 1
        if orphan and not supervisors & {each.pid for each in line}:
            left.append(f"{' '.join(words[place + 2 : place + 3])} ({process.info['pid']})")
    if left:
        yield warn(
            "processes",
            f"without a supervisor: {', '.join(sorted(left)[:10])}",
            "if you did not start them on purpose, end them: kill PID",
        )
    else:
        yield ok(
            "processes", f"{run} services run, each below a supervisor or a terminal" if run else "none is left over"
        )


def fleets() -> Iterator[Finding]:
    """Report the running fleets, and their disks."""
    for each in running_fleets():
        yield ok("fleet", f"{each.fleet} ({each.mode}) on port {each.port}, supervisor {each.pid}, {each.folder}")
        yield from disk(each.fleet, each.folder)
