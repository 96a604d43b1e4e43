"""Imports MuJoCo without its OpenGL, which starts a process and takes a tenth of a second, for images only."""

from __future__ import annotations

import os
import sys

__all__ = ["mujoco"]

_GL = "MUJOCO_GL"

_chosen = os.environ.get(_GL)
os.environ[_GL] = "disable"
try:
    import mujoco
finally:
    if _chosen is None:
        del os.environ[_GL]
    else:
        os.environ[_GL] = _chosen


def _write_warning(warning: str) -> None:
    sys.stderr.write(f"MuJoCo warns: {warning}\n")


# By default it writes warnings and errors to MUJOCO_LOG.TXT in the current folder. Here its errors are exceptions.
_logging = mujoco.MjLogConfig.get()
_logging.logto_file = False
_logging.set()
mujoco.set_mju_user_warning(_write_warning)
