"""The active emergency stops, by robot and holder, kept through a restart of the simulation."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import msgspec

from messages.elea import EmergencyStop
from messages.std import Bool
from messages.topics import E_STOP
from services.runtime.atomic_file import write_atomic
from services.runtime.errors import BadInput, unknown_name
from services.runtime.log import Log
from services.runtime.transport.wire import NODE_BYTES, SampleInfo

ALL_ROBOTS = ""
"""In place of a robot's name: the stop of all robots, including those spawned later."""

FOREIGN_ID, FOREIGN = "foreign", "(foreign)"
"""The holder for publishers without an attachment: they cannot be distinguished, so all are one holder."""
DAMAGED_ID, DAMAGED = "damaged", "(damaged file)"
"""Holds all robots if the file cannot be read: it may have contained any stop."""
OTHERS_ID, OTHERS = "others", "(others)"
"""One holder in place of all beyond MAX_HOLDERS."""

MAX_HOLDERS = 32
"""Maximum number of holders per robot, so that forged ids fill neither memory nor disk."""
MAX_FILE_BYTES = 1 << 22
"""Maximum size of the file, bytes."""
MAX_DELETED = 1000
"""Maximum number of deleted robots whose last samples are remembered."""
RETRY_S = 1.0
"""Wall time between two attempts to write the file."""


class _File(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The content of the file; ``seal`` is the SHA-256 of the stops, which reveals any damage."""

    version: Literal[1] = 1
    seal: str
    stops: tuple[EmergencyStop, ...]


class EmergencyStopStore:
    """The active stops, by robot and holder. A holder is a node by name, so it stays the same after a restart.

    A stop ends when its holder publishes false, by ``release``, or by ``remove_robot`` when the robot is deleted. It
    does not end when the holder's process exits or the simulation restarts.

    Args:
        path: The file that keeps them; None to keep them in memory only.
        name_of: Returns the name of the node whose publisher ids begin with these bytes; empty while it is unknown.
        log: Logs stops, releases and file errors.
        wall: The machine's clock, ns.
        monotonic: A clock that is never set, s.
    """

    def __init__(
        self,
        path: Path | None,
        name_of: Callable[[bytes], str],
        log: Log,
        wall: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._node_name, self._log = path, name_of, log
        self._wall, self._monotonic = wall, monotonic
        self._stops: dict[str, dict[str, EmergencyStop]] = {}
        self._heard: dict[str, dict[bytes, SampleInfo]] = {}
        """By robot, the last sample of each publisher."""
        self._heard_by_deleted: dict[str, dict[bytes, SampleInfo]] = {}
        self._changed = self._unsaved = self._warned_no_file = False
        self._retry_at = 0.0

    def load(self) -> None:
        """Restore the stops from the file; if it is damaged, stop all robots."""
        if self._path is None:
            return
        try:
            stops = _read(self._path)
        except FileNotFoundError:
            return
        except (OSError, ValueError) as error:
            self._fail_closed(self._path, error)
            return
        for each in stops:
            self._stops.setdefault(each.robot, {})[each.id] = each
        if stops:
            names = ", ".join(sorted({_robot_label(each.robot) for each in stops}))
            self._log.warn(f"emergency stops from before the restart are still active: {names} (./elea sim stops)")

    @property
    def all(self) -> tuple[EmergencyStop, ...]:
        """All active stops."""
        return tuple(each for held in self._stops.values() for each in held.values())

    def holders(self, robot: str) -> tuple[str, ...]:
        """Return the holders of a robot's own stops and of those for all robots; empty if it may move."""
        if not self._stops:
            return ()
        held = (*self._stops.get(robot, {}).values(), *self._stops.get(ALL_ROBOTS, {}).values())
        return tuple(dict.fromkeys(each.holder for each in held))

    def process(self, robot: str, topic: str, batch: list[tuple[Any, SampleInfo | None]]) -> bool:
        """Apply ``e_stop`` messages of a robot or of ALL_ROBOTS; return whether any was a stop, even if reset since.

        Samples already received for a deleted robot of the same name are ignored. As the topic is latched, they arrive
        again while their publisher does not know yet that the robot was deleted.
        """
        any_stop = False
        for message, origin in batch:
            assert isinstance(message, Bool)
            if origin is not None:
                if self._heard_by_deleted.get(robot, {}).get(origin.publisher) == origin:
                    continue
                heard = self._heard.setdefault(robot, {})
                if origin.publisher in heard or len(heard) < MAX_HOLDERS:
                    heard[origin.publisher] = origin
            holder = FOREIGN_ID if origin is None else origin.publisher[:NODE_BYTES].hex()
            if message.data:
                any_stop = True
                self._add(robot, topic, holder)
            else:
                self._reset(robot, holder)
        return any_stop

    def release(self, robot: str, holder: str = "") -> str:
        """Release the stops of one holder (by name or id) or of all, on a robot or ALL_ROBOTS.

        Returns:
            A sentence: what was released, and which holders remain.

        Raises:
            BadInput: There is nothing to release.
        """
        held = self._stops.get(robot, {})
        if not held:
            stopped = ", ".join(sorted(map(_robot_label, self._stops))) or "none"
            raise BadInput(f"no emergency stop of {_robot_label(robot)} to release (active stops: {stopped})")
        chosen = [each for each in held.values() if holder in ("", each.holder, each.id)]
        if not chosen:
            raise unknown_name("holder", holder, [each.holder for each in held.values()], _robot_label(robot))
        for each in chosen:
            self._remove(robot, each.id)
        names = ", ".join(each.holder for each in chosen)
        self._log.warn(f"{_robot_label(robot)}: the emergency stop of {names} is released by request")
        left = ", ".join(self.holders(robot))
        return f"{_robot_label(robot)}: the stop of {names} is released" + (
            f"; still stopped by {left}" if left else ""
        )

    def remove_robot(self, robot: str) -> None:
        """Drop the stops of a deleted robot."""
        if self._stops.pop(robot, None) is not None:
            self._changed = True
        if heard := {**self._heard_by_deleted.pop(robot, {}), **self._heard.pop(robot, {})}:
            self._heard_by_deleted[robot] = dict([*heard.items()][-MAX_HOLDERS:])
            if len(self._heard_by_deleted) > MAX_DELETED:
                del self._heard_by_deleted[next(iter(self._heard_by_deleted))]

    def save(self) -> bool:
        """Write changes, retry failed writes, and return whether anything has changed since the last call.

        What it returns may be reported as done: it is on disk, or the log says that it is not.
        """
        if self._stops:
            self._update_names()
        changed, self._changed = self._changed, False
        if self._path is None:
            if self._stops and not self._warned_no_file:
                self._warned_no_file = True
                self._log.warn(
                    "emergency stops are kept in memory only and are lost on a restart (set --param stops_file=PATH)"
                )
        elif changed or (self._unsaved and self._monotonic() >= self._retry_at):
            self._write(self._path)
        return changed

    def _add(self, robot: str, topic: str, holder: str) -> None:
        held = self._stops.get(robot, {})
        if holder in held:
            return
        if len(held) >= MAX_HOLDERS:
            holder = OTHERS_ID
            if holder in held:
                return
        stop = EmergencyStop(robot=robot, topic=topic, holder=self._holder_name(holder), id=holder, since=self._wall())
        self._stops.setdefault(robot, {})[holder] = stop
        self._changed = True
        self._log.warn(f"{_robot_label(robot)}: emergency stop by {stop.holder}", every=0.1)

    def _reset(self, robot: str, holder: str) -> None:
        stop = self._stops.get(robot, {}).get(holder)
        if stop is None:
            return
        self._remove(robot, holder)
        left = ", ".join(self.holders(robot))
        still = f"; still stopped by {left}" if left else ""
        self._log.info(f"{_robot_label(robot)}: the emergency stop of {stop.holder} is reset{still}", every=0.1)

    def _remove(self, robot: str, holder: str) -> None:
        del self._stops[robot][holder]
        if not self._stops[robot]:
            del self._stops[robot]
        self._changed = True

    def _holder_name(self, holder: str) -> str:
        special = {FOREIGN_ID: FOREIGN, DAMAGED_ID: DAMAGED, OTHERS_ID: OTHERS}
        return special.get(holder) or self._node_name(bytes.fromhex(holder)) or f"#{holder}"

    def _update_names(self) -> None:
        """Fill in names of holders whose token came after their stop."""
        for robot, held in self._stops.items():
            for holder, stop in held.items():
                if stop.holder == f"#{holder}" and (name := self._holder_name(holder)) != stop.holder:
                    self._stops[robot][holder] = msgspec.structs.replace(stop, holder=name)
                    self._changed = True

    def _write(self, path: Path) -> None:
        content = _File(seal=_checksum(self.all), stops=self.all)
        try:
            write_atomic(path, msgspec.json.format(msgspec.json.encode(content), indent=2) + b"\n", durable=True)
        except OSError as error:
            self._unsaved, self._retry_at = True, self._monotonic() + RETRY_S
            self._log.error(
                f"emergency stops cannot be written to {path} ({error.strerror}): they stay active, but would be lost "
                "if the simulation restarted now; retrying every second. Is the disk full?",
                every=10.0,
            )
            return
        if self._unsaved:
            self._unsaved = False
            self._log.info(f"emergency stops are written to {path} again")

    def _fail_closed(self, path: Path, error: Exception) -> None:
        kept = path.with_name(f"{path.name}.damaged")
        try:
            kept.unlink(missing_ok=True)
            # Linked, not moved: if it were gone and no new file could be written, the next start would stop nobody.
            kept.hardlink_to(path)
            where = f"it is kept as {kept}"
        except OSError as link_error:
            where = f"it could not be copied: {link_error.strerror}"
        stop = EmergencyStop(topic=f"/{E_STOP.name}", holder=DAMAGED, id=DAMAGED_ID, since=self._wall())
        self._stops[ALL_ROBOTS] = {DAMAGED_ID: stop}
        self._changed = True
        self._log.error(
            f"the file of emergency stops {path} cannot be read ({error}), so all robots are stopped, as it may have "
            f"contained stops; {where}. Release them with ./elea sim release --all"
        )


def _robot_label(name: str) -> str:
    return name or "all robots"


def _checksum(stops: tuple[EmergencyStop, ...]) -> str:
    return hashlib.sha256(msgspec.json.encode(stops)).hexdigest()


def _read(path: Path) -> tuple[EmergencyStop, ...]:
    """Return the stops in a file; raises OSError, or ValueError if it is damaged."""
    with path.open("rb") as file:
        content = file.read(MAX_FILE_BYTES + 1)
    if len(content) > MAX_FILE_BYTES:
        raise ValueError(f"it has more than {MAX_FILE_BYTES} bytes")
    found = msgspec.json.decode(content, type=_File)
    if found.seal != _checksum(found.stops):
        raise ValueError("its checksum does not match its content")
    if any(not each.id or not each.topic for each in found.stops):
        raise ValueError("a stop has no holder or no topic")
    return found.stops
