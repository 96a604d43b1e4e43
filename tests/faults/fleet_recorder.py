"""A node that only observes: robots, heartbeats, liveliness tokens and the fleet state, polled by the test."""

from __future__ import annotations

from collections.abc import Iterable

from messages.elea import Health, ProcessState
from messages.topics import FLEET_STATE, HEALTH
from services.runtime.graph import Entity, token_pattern
from services.runtime.node import Node
from tests.harness.robot_recorder import RobotRecorder


class FleetRecorder:
    """Everything received so far; ``poll`` adds new messages."""

    def __init__(self, node: Node, robots: Iterable[str]) -> None:
        self.node = node
        self.robots = {name: RobotRecorder(node, name) for name in robots}
        self.health: dict[str, tuple[int, Health]] = {}
        self.beats: list[tuple[int, Health]] = []
        self.processes: dict[str, ProcessState] = {}
        self.started_ns: dict[int, int] = {}
        self.sessions: dict[str, set[str]] = {}
        self._health, self._fleet = node.subscribe(HEALTH), node.subscribe(FLEET_STATE)
        self._tokens = node.transport.watch(token_pattern("node"))

    def poll(self) -> None:
        """Read new messages: all heartbeats and each node's latest one with their sending times [ns], the processes,
        the time [ns] of the supervisor's first report of each process id, and the sessions that hold each node's token.
        """
        for track in self.robots.values():
            track.poll()
        self._health.update()
        beats = [(origin.source_ns, beat) for beat, origin in self._health.messages if origin]
        self.beats += beats
        self.health |= {each[1].node: each for each in beats}
        self._fleet.update()
        for state, origin in self._fleet.messages:
            self.processes = {each.name: each for each in state.processes}
            if origin is not None:
                self.started_ns = {each.pid: origin.source_ns for each in state.processes} | self.started_ns
        while (event := self._tokens.poll()) is not None:
            entity = Entity.parse(event.key)
            if entity is None:
                continue
            sessions = self.sessions.setdefault(entity.node, set())
            (sessions.add if event.alive else sessions.discard)(entity.session)

    def alive(self, node: str) -> bool:
        """Whether the node has a liveliness token."""
        return bool(self.sessions.get(node))

    def first_beat(self, node: str, state: str, instant: int) -> int | None:
        """Return the sending time [ns] of a node's first heartbeat in a state after an instant, None without one."""
        found = (sent for sent, beat in self.beats if sent > instant and (beat.node, beat.state) == (node, state))
        return next(found, None)

    def state(self, node: str) -> str:
        """Return the state in the node's latest heartbeat."""
        return self.health[node][1].state if node in self.health else ""
