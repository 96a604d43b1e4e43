"""What the viewer needs: a display, and Vulkan."""

from __future__ import annotations

import ctypes
import os
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path

from deploy.doctor import Finding, ok, warn

DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"), Path("/usr/local/share/vulkan/icd.d"))
SOFTWARE = "on Debian: apt install --no-install-recommends libvulkan1 mesa-vulkan-drivers"


def display(environment: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """A display that answers; without one the viewer does not open by itself."""
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
        yield warn("display", f"WAYLAND_DISPLAY is {wayland}, but nobody is there", "unset it, or log in on the screen")
    else:
        yield ok("display", "none: the viewer does not open by itself, recordings can be looked at elsewhere")


def vulkan() -> Iterator[Finding]:
    """The loader and a driver of Vulkan, with which the viewer draws."""
    try:
        ctypes.CDLL("libvulkan.so.1")
    except OSError:
        yield warn("vulkan", "libvulkan.so.1 is not there: the viewer draws nothing, all else works", SOFTWARE)
        return
    stated = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    drivers = [Path(each) for each in stated.split(":")] if stated else [f for d in DRIVERS for f in d.glob("*.json")]
    if any(each.is_file() for each in drivers):
        yield ok("vulkan", f"{len(drivers)} drivers, {drivers[0].stem} for one")
    else:
        yield warn("vulkan", "there is no driver: the viewer draws nothing, all else works", SOFTWARE)
