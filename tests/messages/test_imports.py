"""Imports: ``messages`` loads nothing heavy, since --help, the graph and foreign programs use it; Ctrl-C ends them."""

import subprocess
import sys
from pathlib import Path

import messages
from services.runtime.process import ROOT
from tests.harness.cases import case

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


INTERRUPT = """
import importlib, sys

class Interrupter:
    interrupted = False

    def find_spec(self, name, path=None, target=None):
        if name == "_datetime" and not self.interrupted:
            self.interrupted = True
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupter())
try:
    importlib.import_module(sys.argv[1])
except KeyboardInterrupt:
    print("interrupted")
"""


def test_ctrl_c_while_msgspec_is_imported_is_not_lost() -> None:
    """As if it arrived while datetime is imported, which msgspec does in C without looking at errors."""
    for module in ("messages.base", "services.runtime.main", "services.script.run", "deploy.__main__", "models.urdf"):
        command = [sys.executable, "-c", INTERRUPT, module]
        ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
        with case(module):
            assert (ran.returncode, ran.stdout, ran.stderr) == (0, "interrupted\n", "")
