"""A script's own modules, our replacements for Python's modules, and missing imports."""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml

from services.script.loader import ScriptLoader, loop_pass, pin_randomness, python2_builtins
from services.script.workspace import workspace_of

MISSING = {
    "moveit_commander": "`moveit_commander` is not part of Elea (import in main.py:2): motion planning",
    "simple_pid": "`simple_pid` is not installed (import in main.py:2): uv pip install --python",
    "strange_msgs.msg": "the message package `strange_msgs` was not found (import in main.py:2)",
    "rviz": "`rviz` is not part of Elea (import in main.py:2): there is no rviz; ./elea view shows",
    "nowhere_to_be_found": "`nowhere_to_be_found` is not part of Elea, nor in the script's folder or workspace",
    "strange.cfg": "the package `strange` of this .cfg was not found (import in main.py:2)",
    "json.nothing": "`json` has no module `nothing`",
    "mypkg.lost": "package `mypkg` ",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The script's folder, first on the path; its modules are unloaded afterwards."""
    known, finders, main = set(sys.modules), list(sys.meta_path), sys.modules["__main__"]
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr(sys, "argv", ["main.py"])
    yield tmp_path
    sys.meta_path[:] = finders
    sys.modules["__main__"] = main
    for name in set(sys.modules) - known:
        if getattr(sys.modules[name], "__file__", None) and str(tmp_path) in str(sys.modules[name].__file__):
            del sys.modules[name]


def run(folder: Path, source: str, modules: dict[str, ModuleType] | None = None) -> dict[str, object]:
    file = folder / "main.py"
    file.write_text(source)
    ScriptLoader([folder], modules or {}, python2_builtins(input), workspace_of(file, {})).run(file)
    return vars(sys.modules["__main__"])


def test_own_modules_get_our_time_and_libraries_python_s(folder: Path) -> None:
    ours = ModuleType("time")
    ours.sleep = "ours"  # type: ignore[attr-defined]
    (folder / "own_helper.py").write_text("from time import sleep\nimport threading\nprinted = xrange(2)\n")
    found = run(folder, "import time, own_helper\nfrom own_helper import sleep\nimport sched\n", {"time": ours})
    assert found["time"] is ours
    assert found["sleep"] == "ours"
    assert vars(sys.modules["sched"])["time"] is not ours
    assert found["__file__"] == "main.py"
    assert found["__name__"] == "__main__"
    assert not (folder / "__pycache__").exists()


def test_an_import_that_is_not_there_names_itself_and_its_line(folder: Path) -> None:
    (folder / "package.xml").write_text("<package><name>mypkg</name></package>")
    for name, text in MISSING.items():
        with pytest.raises(ModuleNotFoundError) as raised:
            run(folder, f"x = 1\nimport {name}\n")
        assert str(raised.value).startswith(text)
    (folder / "uses_missing.py").write_text("\n\nimport pandas_of_the_forest\n")
    with pytest.raises(ModuleNotFoundError, match=r"import in uses_missing.py:3"):
        run(folder, "import uses_missing\n")
    assert run(folder, "try:\n    import nowhere_at_all\nexcept ImportError:\n    x = 3\n")["x"] == 3


def test_a_module_beside_the_importing_one_is_found_as_by_python_2(folder: Path) -> None:
    (folder / "kit").mkdir()
    (folder / "kit/__init__.py").write_text("")
    (folder / "kit/parts.py").write_text(
        "import sizes as s\nfrom colours import red\nimport sizes\nboth = s is sizes\n"
    )
    (folder / "kit/sizes.py").write_text("")
    (folder / "kit/colours.py").write_text("red = 3\n")
    (folder / "kit/broken.py").write_text("import lost\n")
    found = run(folder, "from kit.parts import both, red\n")
    assert (found["both"], found["red"]) == (True, 3)
    assert "kit.sizes" in sys.modules
    with pytest.raises(ModuleNotFoundError, match=r"import in broken.py:1"):
        run(folder, "import kit.broken\n")


def test_opencv_without_a_display_shows_nothing_and_goes_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DISPLAY", "")
    monkeypatch.setenv("WAYLAND_DISPLAY", "")
    (folder / "cv2.py").write_text("def imshow(*_):\n    raise RuntimeError\ndef cvtColor(image):\n    return image\n")
    waits: list[float] = []
    ours = ModuleType("time")
    ours.sleep = waits.append  # type: ignore[attr-defined]
    source = (
        "import cv2\nfor _ in range(2):\n    cv2.imshow('w', [])\n    key = cv2.waitKey(30) & 0xFF\n"
        "cv2.destroyAllWindows()\nsame = cv2.cvtColor(5)\n"
    )
    found = run(folder, source, {"time": ours})
    assert (found["key"], found["same"], waits) == (255, 5, [0.03, 0.03])
    assert capfd.readouterr().err.count("cv2.imshow: no window can be opened here") == 1


@pytest.fixture
def libraries() -> Iterator[None]:
    """Restores numpy and yaml, which a script's import adapts."""
    before = [(vars(each), dict(vars(each))) for each in (np, yaml)]
    yield
    for names, kept in before:
        for name in [name for name, value in names.items() if name not in kept and not isinstance(value, ModuleType)]:
            del names[name]
        names.update(kept)


NAMES_OF_NUMPY = """
import numpy
import numpy as np
pixels = np.zeros(3, np.uint8)
data = pixels.tostring()
again = np.fromstring(data, np.uint8)
again[0] = 7
typed = np.fromstring("1 2 3", dtype=int, sep=" ").tolist()
text = np.fromstring("ab", np.uint8).tolist()
names = [np.float, np.int, np.Inf, np.float_, np.product([2, 3]), np.trapz([1, 1]), np.in1d([1, 5], [5]).tolist()]
class Own:
    def tostring(self):
        return "own"
    def tobytes(self):
        return "bytes"
own = Own().tostring()
"""


def test_libraries_have_the_names_of_ros_1_s_time(folder: Path, libraries: None) -> None:
    found = run(folder, NAMES_OF_NUMPY)
    assert (found["data"], found["own"]) == (b"\0\0\0", "own")
    assert found["again"].tolist() == [7, 0, 0]  # type: ignore[attr-defined]
    assert (found["typed"], found["text"]) == ([1, 2, 3], [97, 98])
    assert found["names"] == [float, int, float("inf"), np.float64, 6, 1.0, [False, True]]
    found = run(
        folder,
        "import yaml\nfrom yaml import load\none = yaml.load('a: 1')\ntwo = load('[2]')\n"
        "three = yaml.load('3', Loader=yaml.SafeLoader)\nfour = list(yaml.load_all('4', yaml.SafeLoader))\n",
    )
    assert [found[each] for each in ("one", "two", "three", "four")] == [{"a": 1}, [2], 3, [4]]
    with pytest.raises(AttributeError, match="no attribute 'tostring'"):
        run(folder, "None.tostring()\n")


def test_modules_of_python_2_are_those_of_today(folder: Path) -> None:
    found = run(
        folder, "import Queue, ConfigParser\nfrom StringIO import StringIO\nimport cPickle as pickle, exceptions\n"
    )
    assert found["exceptions"].ValueError is ValueError
    assert found["Queue"] is sys.modules["queue"]
    assert found["pickle"] is sys.modules["pickle"]


def test_a_hundred_passes_make_one_point() -> None:
    points: list[float] = []
    passed = loop_pass(points.append)
    for _ in range(250):
        passed()
    assert points == [1.0, 1.0]


def test_random_numbers_depend_on_the_seed_and_the_node(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "urandom", os.urandom)
    monkeypatch.setattr(random, "_urandom", os.urandom)
    own, numpy_s = random.getstate(), np.random.get_state()

    def drawn(seed: int, node: str) -> tuple[float, float, bytes]:
        pin_randomness(seed, node)("numpy")
        return random.random(), float(np.random.random()), os.urandom(4)

    try:
        runs = [drawn(seed, node) for seed, node in ((0, "/a"), (1, "/a"), (0, "/b"))]
        assert runs[0] == drawn(0, "/a")
        assert [len(set(each)) for each in zip(*runs, strict=True)] == [3, 3, 3]
    finally:
        random.setstate(own)
        np.random.set_state(numpy_s)
