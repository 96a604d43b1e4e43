"""Supervises three children, one with a child of its own, until it is killed; argument: the run's folder."""

import asyncio
import sys
from pathlib import Path

from tests.deploy.supervisor.supervisor_harness import SupervisorHarness, faulty_process

harness = SupervisorHarness(Path(sys.argv[1]))
supervisor = harness.supervisor(
    faulty_process("good", "/a"), faulty_process("parent", "/b"), faulty_process("deaf", "/c")
)
asyncio.run(supervisor.run())
