"""The machine: platform, Python, cores, memory, clock, loopback."""

from __future__ import annotations

import os
import platform
import socket
import sys
import time
from collections.abc import Iterator

from deploy.doctor import Finding, fail, ok, warn

WANTED = (3, 11)
FEW_CORES = 2
LITTLE_MIB = 1024
"""Memory that a fleet of five robots with its recording takes, and some more."""
_DAWN = 1_735_689_600
"""2025-01-01 UTC, s; a clock that tells an earlier date was never set."""
_STEP_S = 0.05


def python() -> Iterator[Finding]:
    """CPython 3.11, for which PyBullet and rerun have packages."""
    version = platform.python_version()
    if sys.version_info[:2] == WANTED and sys.implementation.name == "cpython":
        yield ok("python", f"{version} at {sys.executable}")
    else:
        yield fail(
            "python",
            f"{sys.implementation.name} {version}; PyBullet has packages for CPython 3.11 alone",
            "install uv, or python3.11 with venv, remove .venv, and start ./elea again",
        )


def system() -> Iterator[Finding]:
    """Linux on x86_64."""
    here = f"{platform.system()} {platform.release()} on {platform.machine()}"
    if (platform.system(), platform.machine()) == ("Linux", "x86_64"):
        yield ok("platform", here)
    else:
        yield fail(
            "platform", f"{here}; PyBullet has packages for Linux on x86_64 alone", "use such a machine, or a container"
        )


def capacity() -> Iterator[Finding]:
    """Cores and memory."""
    import psutil

    cores, memory = len(os.sched_getaffinity(0)), psutil.virtual_memory()
    load = os.getloadavg()[0]
    if cores < FEW_CORES:
        yield warn("cores", f"{cores} may be used", f"a fleet runs, slowly; {FEW_CORES} or more are better")
    elif load > 1.5 * cores:
        yield warn(
            "cores", f"{cores}, with {load:.1f} processes that want one", "end what else runs: real time may lag"
        )
    else:
        yield ok("cores", f"{cores}, load {load:.1f}")
    free = memory.available // 2**20
    if free < LITTLE_MIB:
        yield warn("memory", f"{free} MiB available", f"end what else runs: a fleet wants about {LITTLE_MIB} MiB")
    else:
        yield ok("memory", f"{free} MiB available")


def clock() -> Iterator[Finding]:
    """A wall clock that was set and does not step; control does not use it, logs and recordings do."""
    before = time.time() - time.monotonic()
    time.sleep(_STEP_S)
    step = abs(time.time() - time.monotonic() - before)
    if time.time() < _DAWN:
        yield fail(
            "clock", f"the wall clock says {time.strftime('%Y-%m-%d')}", "set the date: timedatectl set-ntp true"
        )
    elif step > _STEP_S / 2:
        yield warn(
            "clock", f"the wall clock stepped by {step * 1000:.0f} ms", "see to the time service: chronyc tracking"
        )
    else:
        yield ok("clock", time.strftime("%Y-%m-%d %H:%M:%S %Z, steady"))


def loopback() -> Iterator[Finding]:
    """127.0.0.1 carries data."""
    try:
        with (
            socket.create_server(("127.0.0.1", 0)) as server,
            socket.create_connection(server.getsockname(), timeout=2.0) as near,
            server.accept()[0] as far,
        ):
            far.settimeout(2.0)
            began = time.perf_counter()
            near.sendall(b"elea")
            heard = far.recv(4)
            took = time.perf_counter() - began
    except OSError as error:
        yield fail("loopback", f"127.0.0.1 does not work: {error.strerror or error}", "bring it up: ip link set lo up")
        return
    if heard == b"elea":
        yield ok("loopback", f"127.0.0.1, {took * 1e6:.0f} us")
    else:
        yield fail("loopback", "127.0.0.1 lost what was sent", "look for a firewall on lo: nft list ruleset")
