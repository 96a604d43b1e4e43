"""Conversion of Python 2, scheduling points in loops, and line numbers of errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from services.script.loader import python2_builtins
from services.script.source import PASS, compile_script, parse_script
from tests.harness.cases import case

CONVERTED = {
    "print": ('print "a", 1\nr = 2\nprint r', "a 1\n2\n"),
    "print to nowhere": ("print", "\n"),
    "except": ("try:\n    1 / 0\nexcept ZeroDivisionError, e:\n    print 'caught'", "caught\n"),
    "raw_input": ("print raw_input('? ')", "line\n"),
    "input evaluates": ("print input() + 1", "42\n"),
    "xrange": ("print [i for i in xrange(3)]", "[0, 1, 2]\n"),
    "has_key": ("print {1: 2}.has_key(1)", "True\n"),
    "division": (
        "x = 3.0\nn = 7\nprint 1/2, -7/2, (1+2)/2, 1/2.0, x/2, [4, 5][n/4]\nn /= 2\nprint n",
        "0 -4 1 0.5 1.5 5\n3\n",
    ),
    "division of an attribute": (
        "class C: pass\nc = C()\nc.n = 7\nc.n /= 2\nc.x = 7.0\nc.x /= 2\nprint c.n, c.x",
        "3 3.5\n",
    ),
    "tabs": ("for i in range(2):\n\tif i:\n        \tprint 'in', i\n", "in 1\n"),
    "late globals": (
        "n = 1\nglobal n\ndef f():\n    'doc'\n    n = 5\n    global n\n    print f.__doc__\nf()\nprint n",
        "doc\n5\n",
    ),
    "dictionaries": ("print sorted(k + v for k, v in {1: 2}.iteritems())", "[3]\n"),
    "raise": ("try:\n    raise ValueError, 'why'\nexcept ValueError as e:\n    print e", "why\n"),
    "exec": ("exec 'x = 5'\nprint x", "5\n"),
    "not equal": ("print 1 <> 2, 0777, 5L, `3`", "True 511 5 3\n"),
    "names": (
        "print unicode('a'), basestring, reduce(lambda a, b: a + b, [1, 2]), cmp(1, 2)",
        "a <class 'str'> 3 -1\n",
    ),
}


def run(path: Path, capsys: pytest.CaptureFixture[str], inputs: str = "line") -> tuple[str, str, dict[str, Any]]:
    """Run a file; return its output, the loader's messages, and its globals."""
    passes: list[int] = []

    def read_line(prompt: str = "") -> str:
        return inputs

    names = {**__builtins__, **python2_builtins(read_line), "input": read_line, PASS: lambda: passes.append(1)}  # type: ignore[dict-item]
    scope: dict[str, Any] = {"__builtins__": names, "__name__": "__main__"}
    exec(compile_script(path), scope)
    printed = capsys.readouterr()
    scope["passes"] = len(passes)
    return printed.out, printed.err, scope


def test_python_2_is_converted_and_one_line_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "old.py"
    for name, (source, expected) in CONVERTED.items():
        with case(name):
            file.write_text(source if "print " in source else source + "\nprint ''[0:]")
            out, said, _ = run(file, capsys, "41" if "evaluates" in name else "line")
            assert out.startswith(expected)
            assert said == "old.py: is Python 2: converted as it is loaded, the file stays as it is\n"


def test_python_3_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "new.py"
    file.write_text("# -*- coding: latin-1 -*-\nprint(1/2, '\xe9', input('? '))\n", "latin-1")
    assert run(file, capsys)[:2] == ("0.5 \xe9 line\n", "")
    file.write_text("if True:\n\tx = 1\n        y = 2\nprint(x / 2)\n")
    assert run(file, capsys)[:2] == ("0.5\n", "new.py: tabs mixed with spaces are taken as 8 columns\n")


def test_tabs_mixed_with_spaces_may_be_python_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "tabs.py"
    file.write_text("d = {1: 2}\nfor i in range(2):\n\tif i:\n        \tprint(list(d.iteritems()), 1 / 2)\n")
    out, said, _ = run(file, capsys)
    assert (out, said[:23]) == ("([(1, 2)], 0)\n", "tabs.py: is Python 2: c")


def test_loops_without_an_end_have_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "loops.py"
    file.write_text(
        "from __future__ import annotations\nimport itertools\n"
        "i = 0\nwhile i < 5:\n    '''text'''\n    i += 1\nelse:\n    j = 1\n"
        "for k in itertools.count():\n    if k == 2: break\n"
        "for k in range(10): pass\nwhile i: i -= 1\n"
    )
    assert run(file, capsys)[2]["passes"] == 5 + 3 + 5


def test_errors_have_the_lines_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "bad.py"
    file.write_text("x = 1\nwhile x:\n    print('a')\n    x = y\n")
    with pytest.raises(NameError) as raised:
        run(file, capsys)
    assert raised.traceback[-1].lineno == 3
    file.write_text("x = 1\ny = 2\nprint 'a'\nwhile x:\n    print x\n    raise ValueError, 'b'\n")
    with pytest.raises(ValueError, match="b") as other:
        run(file, capsys)
    assert other.traceback[-1].lineno == 5
    for source, line in (
        ("x = (1)\ny = [\n    x,\n].tostring()\n", 4),
        ("x = [\n    1,\n    None\n    .tostring(\n    ),\n]\n", 4),
        ("x = 1\nx.tostring()\n", 2),
    ):
        with case(source):
            file.write_text(source)
            with pytest.raises(AttributeError) as missing:
                run(file, capsys)
            entries = [each for each in missing.traceback if each.path == file]
            with pytest.raises(AttributeError) as plain:
                exec(compile(source, str(file), "exec"), {})
            assert [each.lineno + 1 for each in entries] == [line] == [plain.traceback[-1].lineno + 1]
    for source, line in (("x = 1\ndef f(:\n    pass\n", 2), ("print 'a'\nx = = 2\n", 2), ("x = '\0'\n", 1)):
        with case(source):
            file.write_text(source)
            with pytest.raises(SyntaxError) as fault:
                compile_script(file)
            assert fault.value.lineno == line
            assert fault.value.filename == str(file)


NUMBERS_TYPED = (
    'speed = input("speed")\nv = abs(speed)',
    'angle = input("angle")\nr = angle*2*3.14/360',
    'goal = Pose()\ngoal.x = input("x")',
    "def far(a, b):\n    return b - 1.5\ntolerance = input()\nfar(0, tolerance)",
    "class Robot:\n    def go(self):\n        self.far = input()\n    def on(self):\n        self.gone < self.far",
    'n = input("how many")\nmsg.linear.x = n',
    "choice = input()\nif choice == 1:\n    pass",
)
TEXTS_TYPED = (
    'speed = float(input("speed"))\nv = abs(speed)',
    'speed = input("speed")\nv = abs(float(speed))',
    'name = input()\nprint("hello " + name)\nprint(name * 3)',
    "key = input()\nif key == 'q' or key < 'c':\n    pass",
    "line = input()\nx = line.split()[0]\nx - 1",
    'class Person:\n    def __init__(self):\n        self.x = input("name")',
    "#!/usr/bin/env python3\nspeed = input()\nabs(speed)",
)


def test_a_program_that_computes_with_what_is_typed_is_python_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for source in (*NUMBERS_TYPED, *TEXTS_TYPED):
        with case(source):
            file = tmp_path / "typed.py"
            file.write_text(source)
            assert parse_script(file)[1] == (source in NUMBERS_TYPED)
    file.write_text('speed = input("speed")\nprint(abs(speed))\n')
    assert run(file, capsys, "-3")[0] == "3\n"
