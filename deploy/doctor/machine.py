"""Checks the machine: platform, Python, CPU, memory, disk, clock, loopback, display."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from deploy.doctor import Finding, fail, ok, warn
from services.runtime.user_folders import instances_folder, runs_folder
from services.sim.engines import ENGINES, PYBULLET_PACKAGES, default_engine, has_engine

PYTHON_VERSIONS = ((3, 11), (3, 12), (3, 13))
MACHINES = ("x86_64", "aarch64")
MIN_CORES = 2
MIN_MEMORY_MIB = 1024
"""Memory that a fleet of five robots with its recording needs, plus a reserve."""
_EARLIEST_DATE_S = 1_735_689_600
"""2025-01-01 UTC [s]; an earlier clock was never set."""
_STEP_S = 0.05
_READINGS = 20


def python_version() -> Iterator[Finding]:
    """Check for CPython 3.11 to 3.13, which the lock covers."""
    version = platform.python_version()
    if sys.version_info[:2] in PYTHON_VERSIONS and sys.implementation.name == "cpython":
        yield ok("python", f"{version} at {sys.executable}")
    else:
        yield fail(
            "python",
            f"{sys.implementation.name} {version}; requirements.lock holds for CPython 3.11 to 3.13",
            "install uv, or one of these with venv, remove .venv, and start ./elea again",
        )


def platform_supported() -> Iterator[Finding]:
    """Check for Linux on x86_64 or ARM."""
    here = f"{platform.system()} {platform.release()} on {platform.machine()}"
    if platform.system() == "Linux" and platform.machine() in MACHINES:
        yield ok("platform", here)
    else:
        yield fail("platform", f"{here}; Elea is for Linux on x86_64 or aarch64", "use such a machine, or a container")


def physics_engines() -> Iterator[Finding]:
    """Check that at least one physics engine is installed."""
    found = [each for each in ENGINES if has_engine(each)]
    if not found:
        yield fail("engines", f"none of {', '.join(ENGINES)} is installed", "remove .venv and start ./elea again")
    elif "pybullet" in found:
        yield ok("engines", f"{', '.join(found)}; {default_engine()} unless a fleet says otherwise")
    else:
        yield ok("engines", f"{', '.join(found)} alone: {PYBULLET_PACKAGES}")


def cores_and_memory() -> Iterator[Finding]:
    """Check the number of cores and the memory."""
    import psutil

    cores, memory = len(os.sched_getaffinity(0)), psutil.virtual_memory()
    load = os.getloadavg()[0]
    if cores < MIN_CORES:
        yield warn("cores", f"{cores} available", f"a fleet runs, slowly; {MIN_CORES} or more are better")
    elif load > 1.5 * cores:
        yield warn("cores", f"{cores}, with {load:.1f} runnable processes", "stop other programs: real time may lag")
    else:
        yield ok("cores", f"{cores}, load {load:.1f}")
    free = memory.available // 2**20
    if free < MIN_MEMORY_MIB:
        yield warn("memory", f"{free} MiB available", f"stop other programs: a fleet needs about {MIN_MEMORY_MIB} MiB")
    else:
        yield ok("memory", f"{free} MiB available")


def clock() -> Iterator[Finding]:
    """Check that the wall clock is set and does not step; control does not use it, logs and recordings do."""
    before = _wall_clock_offset()
    time.sleep(_STEP_S)
    step = abs(_wall_clock_offset() - before)
    if time.time() < _EARLIEST_DATE_S:
        yield fail(
            "clock", f"the wall clock says {time.strftime('%Y-%m-%d')}", "set the date: timedatectl set-ntp true"
        )
    elif step > _STEP_S / 2:
        yield warn(
            "clock", f"the wall clock stepped by {step * 1000:.0f} ms", "check the time service: chronyc tracking"
        )
    else:
        yield ok("clock", time.strftime("%Y-%m-%d %H:%M:%S %Z, steady"))


def _wall_clock_offset() -> float:
    """Return the wall clock's lead over the monotonic clock [s].

    Of several readings the one that took least is used, since this process may be interrupted within one.
    """
    readings = []
    for _ in range(_READINGS):
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        readings.append((after - before, wall - (before + after) / 2))
    return min(readings)[1]


def loopback() -> Iterator[Finding]:
    """Check that 127.0.0.1 transports data."""
    try:
        with (
            socket.create_server(("127.0.0.1", 0)) as server,
            socket.create_connection(server.getsockname(), timeout=2.0) as near,
            server.accept()[0] as far,
        ):
            far.settimeout(2.0)
            began = time.perf_counter()
            near.sendall(b"elea")
            received = far.recv(4)
            took = time.perf_counter() - began
    except OSError as error:
        yield fail("loopback", f"127.0.0.1 does not work: {error.strerror or error}", "bring it up: ip link set lo up")
        return
    if received == b"elea":
        yield ok("loopback", f"127.0.0.1, {took * 1e6:.0f} us")
    else:
        yield fail("loopback", "127.0.0.1 lost the data sent", "look for a firewall on lo: nft list ruleset")


VULKAN_DRIVER_FOLDERS = (
    Path("/usr/share/vulkan/icd.d"),
    Path("/etc/vulkan/icd.d"),
    Path("/usr/local/share/vulkan/icd.d"),
)
VULKAN_INSTALL_HINT = "on Debian: apt install --no-install-recommends libvulkan1 mesa-vulkan-drivers"


def display(environment: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Check for a working display; without one the viewer does not open by itself."""
    wayland, x = environment.get("WAYLAND_DISPLAY", ""), environment.get("DISPLAY", "")
    if wayland:
        path = Path(environment.get("XDG_RUNTIME_DIR", "/run/user/0")) / wayland
        if path.is_socket():
            yield ok("display", f"Wayland, {path}")
            return
    if x.startswith(":"):
        path = Path("/tmp/.X11-unix") / f"X{x[1:].partition('.')[0]}"
        try:
            with socket.socket(socket.AF_UNIX) as probe:
                probe.connect(str(path))
        except OSError as error:
            yield warn(
                "display", f"DISPLAY is {x}, but {path}: {error.strerror}", "unset DISPLAY, or start the X server"
            )
            return
    if x:
        yield ok("display", f"X, DISPLAY={x}")
    elif wayland:
        yield warn(
            "display", f"WAYLAND_DISPLAY is {wayland}, but no compositor answers", "unset it, or log in on the screen"
        )
    else:
        yield ok("display", "none: the viewer does not open by itself; recordings can be viewed elsewhere")


def vulkan() -> Iterator[Finding]:
    """Check for a Vulkan loader and driver, which the viewer needs to draw."""
    try:
        ctypes.CDLL("libvulkan.so.1")
    except OSError:
        yield warn(
            "vulkan", "libvulkan.so.1 is missing: the viewer draws nothing, everything else works", VULKAN_INSTALL_HINT
        )
        return
    stated = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    drivers = (
        [Path(each) for each in stated.split(":")]
        if stated
        else [f for d in VULKAN_DRIVER_FOLDERS for f in d.glob("*.json")]
    )
    if any(each.is_file() for each in drivers):
        yield ok("vulkan", f"{len(drivers)} drivers, e.g. {drivers[0].stem}")
    else:
        yield warn("vulkan", "there is no driver: the viewer draws nothing, everything else works", VULKAN_INSTALL_HINT)


LOW_DISK_MIB, MIN_DISK_MIB = 2048, 64
"""Free space [MiB] below which to warn, and to fail: an hour of a recorded lab takes about 1 GiB."""


def run_folder_writable(runs: Path | None = None) -> Iterator[Finding]:
    """Check that the folder of the runs is writable and has free space."""
    yield from _check_writable(
        "run folder", runs or runs_folder(), "choose another with ./elea up --runs DIR, or fix its ownership: chown"
    )


def state_folder_writable() -> Iterator[Finding]:
    """Check that the folder with the list of running fleets is writable."""
    yield from _check_writable("state folder", instances_folder(), "set ELEA_HOME to a folder of yours")


def _check_writable(name: str, path: Path, do: str) -> Iterator[Finding]:
    there = next(each for each in (path, *path.parents) if each.exists())
    try:
        with tempfile.TemporaryFile(dir=there) as file:
            file.write(b"elea")
        free = shutil.disk_usage(there).free
    except OSError as error:
        yield fail(name, f"{path} cannot be written: {error.strerror}", do)
        return
    yield disk_space(name, path, free)


def disk_space(name: str, path: Path, free: int) -> Finding:
    """Check whether ``free`` bytes are enough on the disk of ``path``."""
    mib = free // 2**20
    if mib < MIN_DISK_MIB:
        return fail(name, f"{path}: {mib} MiB are free", "free space on this disk: runs/ holds old recordings")
    if mib < LOW_DISK_MIB:
        return warn(name, f"{path}: {mib} MiB are free", "free space on this disk: runs/ holds old recordings")
    return ok(name, f"{path}, {mib / 1024:.0f} GiB free")
