"""Supervises three children, one with a child of its own, until it is killed; argument: the run's folder."""

import asyncio
import sys
from pathlib import Path

from tests.deploy.harness import Stage, child

stage = Stage(Path(sys.argv[1]))
supervisor = stage.supervisor(child("good", "/a"), child("parent", "/b"), child("deaf", "/c"))
asyncio.run(supervisor.run())
