"""The interface between an imitated client library (rospy, tf, actionlib …) and the process that runs a foreign script.

The script owns the main thread; a ``Kernel`` works in another. Everything here may be called from any thread that the
kernel knows: the main one, those of ``spawn``, and those that run a ``receive`` or a ``handle``. In lockstep at most
one of these threads runs at a time; each ends its turn in a wait (``sleep_until``, ``wait_until``, the end of a
callback) or when its budget of ``point`` is spent. In real time they run concurrently, as in ROS.

Names are absolute, resolved and remapped by the library; payloads are MessagePack maps.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from services.runtime.errors import EleaError
from services.script.robot_frames import RobotFrames


class ScriptStopped(EleaError):
    """The process is asked to end: raised by waits in simulation time."""


class TimeMovedBackwards(EleaError):
    """Simulation time was reset while a thread slept."""


class ServiceUnavailable(EleaError):
    """No node serves the name."""


class ServiceRefused(EleaError):
    """The server answered with an error, whose reason is the text. A ``handle`` raises it to refuse a request."""


class Origin(NamedTuple):
    """The source of a message: the full name of its publisher's node ("" if unknown), and whether it is latched."""

    node: str
    latched: bool


class Output(Protocol):
    """A publication."""

    def publish(self, payload: bytes) -> None:
        """Publish a message; it leaves at once in real time, at the end of the turn in lockstep. Costs 5 points."""
        ...

    def subscribers(self) -> list[str]:
        """Return the full names of the subscribing nodes, including this one."""
        ...

    def close(self) -> None:
        """Close the publication."""
        ...


class Input(Protocol):
    """A subscription with its own worker thread."""

    def publishers(self) -> list[str]:
        """Return the full names of the publishing nodes."""
        ...

    def close(self) -> None:
        """Close the subscription; a running ``receive`` is completed."""
        ...


class Server(Protocol):
    """A service that this script serves."""

    def close(self) -> None:
        """Close the service."""
        ...


class GraphEntry(NamedTuple):
    """A node's publication (``pub``), subscription (``sub``) or service (``srv``): node, name and type."""

    kind: str
    node: str
    name: str
    type: str


class Parameters(Protocol):
    """The parameter tree shared by all nodes; keys are absolute. A script sees its own writes at once."""

    def get(self, key: str) -> Any:
        """Return the value, or the dict of an inner node; raises KeyError."""
        ...

    def set(self, key: str, value: Any) -> None:
        """Set a value or, with a dict, a whole branch; raises BadInput for an invalid parameter."""
        ...

    def delete(self, key: str) -> None:
        """Delete a value or branch; raises KeyError."""
        ...

    def has(self, key: str) -> bool:
        """Return whether there is a value or branch."""
        ...

    def search(self, namespace: str, key: str) -> str | None:
        """Return the nearest key of this name, from the namespace upwards."""
        ...

    def names(self) -> list[str]:
        """Return the keys of all values, in the order in which they were set."""
        ...


class Kernel(Protocol):
    """The node of a script, as returned by ``services.script.api.kernel()``. It connects when first needed."""

    parameters: Parameters
    frames: RobotFrames
    lockstep: bool
    simulated: bool
    """Whether time is simulation time; False with ``--wall-time``."""

    @property
    def shutting_down(self) -> bool:
        """Whether the process was asked to end, and its hooks have run."""
        ...

    def start(self, node: str, namespace: str, kind: str) -> None:
        """Claim the node's name (``/tb3_0/talker``); raises BadInput if another node holds it. Called once."""
        ...

    def advertise(
        self,
        name: str,
        ros_type: str,
        latched: bool = False,
        queue_size: int = 10,
        joined: Callable[[str], bytes | None] | None = None,
        left: Callable[[str], None] | None = None,
    ) -> Output:
        """Publish on a topic.

        ``joined`` and ``left`` are called with the node of a subscriber that appears or disappears; a payload that
        ``joined`` returns is published.
        """
        ...

    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None = None
    ) -> Input:
        """Subscribe; ``receive`` is called on a thread of this topic. "" or "*" for ``ros_type`` accepts any type.

        With a ``queue_size`` the oldest messages are dropped when more of them wait.
        """
        ...

    def serve(self, name: str, ros_type: str, handle: Callable[[bytes], bytes]) -> Server:
        """Serve ``name``; ``handle`` gets the request's payload and returns the response's, on its own thread."""
        ...

    def call(self, name: str, ros_type: str, payload: bytes, timeout: float | None = None) -> bytes:
        """Call a service of any node and wait; raises ServiceUnavailable, ServiceRefused, ScriptStopped."""
        ...

    def service_type(self, name: str) -> str | None:
        """Return the type of a service, or None without a server."""
        ...

    def graph(self) -> list[GraphEntry]:
        """Return all publications, subscriptions and services on the network."""
        ...

    def nodes(self) -> list[str]:
        """Return the full names of all nodes."""
        ...

    def end_node(self, node: str, reason: str) -> bool:
        """Ask another program's node to end; return whether one will. In lockstep no program ends another."""
        ...

    def now(self) -> int:
        """Return the time [ns] since simulation began, or since 1970 with ``--wall-time``; 0 before the first clock."""
        ...

    def sleep_until(self, time_ns: int) -> None:
        """Sleep until a time; raises ScriptStopped (simulation time only), TimeMovedBackwards."""
        ...

    def wait_until(self, ready: Callable[[], bool], timeout: float | None = None, by_messages: bool = False) -> bool:
        """Wait until ``ready()``, which is checked whenever something has arrived or changed; return whether it holds.

        Returns False after ``timeout`` [s] (wall time; in lockstep simulation time) or when the process ends.
        ``by_messages``: only messages and other threads make it true, so that lockstep need not check it at each tick.
        """
        ...

    def wake(self) -> None:
        """Have all ``ready`` functions checked again."""
        ...

    def point(self, cost: float = 1.0) -> None:
        """Count a query of time, shutdown or state.

        A turn in lockstep ends once 500 points are spent in one tick; in real time a loop that never waits is slowed
        down.
        """
        ...

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        """Start a thread that takes turns like the others; an exception in it is logged, and ends only this thread."""
        ...

    def lock(self) -> Any:
        """Return a reentrant lock (a context manager); waiting for it does not stop the other threads' turns."""
        ...

    def on_shutdown(self, hook: Callable[[], None]) -> None:
        """Call ``hook`` when the process ends, in order of registration, while publishing and sleeping still work."""
        ...

    def shut_down(self, reason: str) -> None:
        """Run the hooks, then end all waits. The script itself may go on."""
        ...

    def log(self, level: int, text: str, where: Mapping[str, Any]) -> None:
        """Publish a line on ``/rosout`` (level 1 to 16; ``where``: file, line, function), without printing it."""
        ...


class NoKernel(EleaError):
    """A client library was imported in a process that runs no script."""


_kernel: Kernel | None = None


def kernel() -> Kernel:
    """Return the kernel of the script that this process runs; raises NoKernel in another process."""
    if _kernel is None:
        raise NoKernel("this process runs no script: start it with ./elea run FILE.py")
    return _kernel


def set_kernel(made: Kernel | None) -> None:
    """Make ``kernel`` return this one; for the start of a process, and for tests."""
    global _kernel
    _kernel = made
