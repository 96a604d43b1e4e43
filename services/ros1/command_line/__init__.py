"""Commands of ROS 1 as programs on our rospy: `./elea env ros1` gives them their names."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable


def run_command(main: Callable[[], None]) -> None:
    """Run a command to its end; one whose reader has gone, as in `rostopic list | head -1`, ends without a word."""
    try:
        main()
        sys.stdout.flush()
    except BrokenPipeError:
        os._exit(0)
