"""Replaces OpenCV's windows where none can be opened: a script's images are not shown, and it goes on."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

_NO_KEY = -1
_SILENT = (
    "namedWindow moveWindow resizeWindow destroyWindow destroyAllWindows setWindowTitle setWindowProperty "
    "startWindowThread setMouseCallback createTrackbar setTrackbarPos setTrackbarMin setTrackbarMax"
)
"""Window functions without a meaningful result."""


def has_windows(cv2: ModuleType, environment: Mapping[str, str]) -> bool:
    """Return whether this OpenCV can open a window on this machine."""
    if sys.platform == "linux" and not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        return False
    built = getattr(cv2, "getBuildInformation", lambda: "")()
    return re.search(r"^\s*GUI:\s*NONE", built, re.MULTILINE) is None


def without_windows(cv2: ModuleType, sleep: Callable[[float], Any]) -> None:
    """Replace the window functions: ``waitKey`` waits and returns no key, ``imshow`` reports once what is missing.

    Args:
        cv2: OpenCV, changed in place.
        sleep: Waits for seconds of the script's time.
    """
    warned = False

    def imshow(*_: Any) -> None:
        nonlocal warned
        if not warned:
            sys.stderr.write("cv2.imshow: no window can be opened here; publish the image to see it in the panel\n")
        warned = True

    def wait_key(delay: float = 0) -> int:
        sleep(max(0.0, delay) / 1000)
        return _NO_KEY

    shown = {"imshow": imshow, "waitKey": wait_key, "waitKeyEx": wait_key, "pollKey": lambda: _NO_KEY}
    shown |= {name: lambda *_, **__: None for name in _SILENT.split()}
    shown |= {"getTrackbarPos": lambda *_: 0, "getWindowProperty": lambda *_: -1.0}
    vars(cv2).update(shown)


def adapt(cv2: ModuleType, sleep: Callable[[float], Any]) -> None:
    """Replace OpenCV's windows for a script if none can be opened."""
    if not has_windows(cv2, os.environ):
        without_windows(cv2, sleep)
