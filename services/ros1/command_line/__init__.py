"""Commands of ROS 1 as programs on our rospy; `./elea env ros1` provides them under their names."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable


def run_command(main: Callable[[], None]) -> None:
    """Run a command to its end; if the reader of its output has gone, as in `rostopic list | head -1`, end quietly."""
    try:
        main()
        sys.stdout.flush()
    except BrokenPipeError:
        os._exit(0)
