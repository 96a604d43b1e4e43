"""Starts a child process that doesn't end with its parent."""

from __future__ import annotations

import subprocess
import sys

from services.runtime import Parameters, Service, main
from services.runtime.context import Context


def run(ctx: Context[Parameters]) -> None:
    subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"], start_new_session=False)
    for _ in ctx.ticks():
        pass


main(Service(name="parent", about="has a child", run=run, rate=5))
