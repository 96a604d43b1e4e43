"""What an imitated client library (rospy, tf, actionlib …) needs of the process that runs a foreign script.

The script owns the main thread, a ``Kernel`` works in another. Everything here may be called from any thread that the
kernel knows: the main one, those of ``spawn``, and those that run a ``receive`` or a ``handle``. In lockstep at most
one of these threads runs at a time; each ends its turn in a wait (``sleep_until``, ``wait_until``, the end of a
callback) or when its budget of ``point`` is spent. In real time they run beside each other, as in ROS.

Names are absolute, resolved and remapped by the library; payloads are MessagePack maps.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from services.runtime.errors import EleaError
from services.script.robot_frames import RobotFrames


class ScriptStopped(EleaError):
    """The process is asked to end: raised by what waits, in simulated time."""


class TimeMovedBackwards(EleaError):
    """Simulation time was reset while a thread slept."""


class ServiceUnavailable(EleaError):
    """No node serves the name."""


class ServiceRefused(EleaError):
    """The server answered with an error, whose reason is the text. A ``handle`` raises it to refuse."""


class Origin(NamedTuple):
    """Where a message comes from: the full name of its publisher's node ("" if unknown), and whether it is latched."""

    node: str
    latched: bool


class Output(Protocol):
    """A publication."""

    def publish(self, payload: bytes) -> None:
        """Send a message; it leaves at once in real time, at the end of the turn in lockstep. Costs 5 points."""
        ...

    def subscribers(self) -> list[str]:
        """The full names of the nodes that subscribe, the own one included."""
        ...

    def close(self) -> None:
        """End it."""
        ...


class Input(Protocol):
    """A subscription with its own worker thread."""

    def publishers(self) -> list[str]:
        """The full names of the nodes that publish."""
        ...

    def close(self) -> None:
        """End it; a ``receive`` that runs comes to its end."""
        ...


class Server(Protocol):
    """A service that this script serves."""

    def close(self) -> None:
        """End it."""
        ...


class GraphEntry(NamedTuple):
    """A node's publication (``pub``), subscription (``sub``) or service (``srv``): node, name and type."""

    kind: str
    node: str
    name: str
    type: str


class Parameters(Protocol):
    """The tree of parameters that all nodes share; keys are absolute. Own writes are seen at once."""

    def get(self, key: str) -> Any:
        """The value, or the dict of an inner node; raises KeyError."""
        ...

    def set(self, key: str, value: Any) -> None:
        """Set a value or, with a dict, a whole branch; raises BadInput for what is not a parameter."""
        ...

    def delete(self, key: str) -> None:
        """Delete a value or branch; raises KeyError."""
        ...

    def has(self, key: str) -> bool:
        """Whether there is a value or branch."""
        ...

    def search(self, namespace: str, key: str) -> str | None:
        """The nearest key of this name, from the namespace upwards."""
        ...

    def names(self) -> list[str]:
        """All keys of values, in the order in which they were set."""
        ...


class Kernel(Protocol):
    """The node of a script: ``services.script.api.kernel()`` gives it. It connects when first needed."""

    parameters: Parameters
    frames: RobotFrames
    lockstep: bool
    simulated: bool
    """Whether time is the simulation's; False with ``--wall-time``."""

    @property
    def shutting_down(self) -> bool:
        """Whether the process was asked to end, and its hooks have run."""
        ...

    def start(self, node: str, namespace: str, kind: str) -> None:
        """Take the node's name (``/tb3_0/talker``); raises BadInput when another node holds it. Once."""
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
        """Publish on a topic. ``joined`` and ``left`` are called with the node of a subscriber that comes or goes; a
        payload that ``joined`` returns is sent."""
        ...

    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None = None
    ) -> Input:
        """Subscribe, with ``receive`` called on a thread of this topic; "" or "*" for ``ros_type`` takes any type.

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
        """The type of a service, or None while nobody serves it."""
        ...

    def graph(self) -> list[GraphEntry]:
        """All publications, subscriptions and services on the network."""
        ...

    def nodes(self) -> list[str]:
        """The full names of all nodes."""
        ...

    def end_node(self, node: str, reason: str) -> bool:
        """Ask another program's node to end; whether there is one that will. In lockstep no program ends another."""
        ...

    def now(self) -> int:
        """Time in ns since simulation began, or since 1970 with ``--wall-time``; 0 while no clock has come."""
        ...

    def sleep_until(self, time_ns: int) -> None:
        """Wait for a time; raises ScriptStopped (simulated time only), TimeMovedBackwards."""
        ...

    def wait_until(self, ready: Callable[[], bool], timeout: float | None = None, by_messages: bool = False) -> bool:
        """Wait until ``ready()``, which is asked whenever something has arrived or changed; False after ``timeout`` [s]
        (wall time, in lockstep simulated) or when the process ends. ``by_messages``: only messages and other threads
        make it true, so that lockstep need not ask at each tick."""
        ...

    def wake(self) -> None:
        """Say that a ``ready`` somewhere may have become true."""
        ...

    def point(self, cost: float = 1.0) -> None:
        """Count a look at time, shutdown or state. A turn of lockstep ends when 500 are spent in one tick; in real time
        a loop that never waits is slowed down."""
        ...

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        """Start a thread that takes turns as the others do; an exception in it is logged, and ends it alone."""
        ...

    def lock(self) -> Any:
        """A reentrant lock (a context manager) whose waiting does not stop the other threads' turns."""
        ...

    def on_shutdown(self, hook: Callable[[], None]) -> None:
        """Call ``hook`` when the process ends, in the order of addition, while publishing and sleeping still work."""
        ...

    def shut_down(self, reason: str) -> None:
        """Run the hooks, then end what waits. The script itself may go on."""
        ...

    def log(self, level: int, text: str, where: Mapping[str, Any]) -> None:
        """Publish a line on ``/rosout`` (level 1 to 16; ``where``: file, line, function), without printing."""
        ...


class NoKernel(EleaError):
    """A client library was imported in a process that runs no script."""


_kernel: Kernel | None = None


def kernel() -> Kernel:
    """The kernel of the script that this process runs; raises NoKernel in another process."""
    if _kernel is None:
        raise NoKernel("this process runs no script: start it with ./elea run FILE.py")
    return _kernel


def set_kernel(made: Kernel | None) -> None:
    """Let ``kernel`` return this one; for the start of a process, and for tests."""
    global _kernel
    _kernel = made
