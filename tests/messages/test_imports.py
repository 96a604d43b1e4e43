"""``messages`` imports nothing heavy, since --help, the graph and foreign programs use it."""

import subprocess
import sys
from pathlib import Path

import messages

PROGRAM = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
heavy = {"numpy", "zenoh", "pybullet", "rerun", "matplotlib", "services", "models", "deploy"}
print(*sorted(heavy & {name.partition(".")[0] for name in sys.modules}))
"""


def test_all_of_messages_loads_nothing_heavy() -> None:
    folder = Path(messages.__path__[0])
    names = sorted(f"messages.{file.stem}" for file in folder.glob("*.py") if file.stem != "__init__")
    assert {"messages.base", "messages.names", "messages.records"} <= set(names)
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM, *names], cwd=folder.parent, capture_output=True, text=True, timeout=60
    )
    assert (ran.returncode, ran.stdout.strip(), ran.stderr) == (0, "", "")
