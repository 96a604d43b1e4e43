"""Records in several threads, as in a script with a thread for each topic."""

from __future__ import annotations

import sys
import threading
import types
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from messages.base import raw_decoder

DEPTH = 12


@pytest.fixture
def frequent_switches() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def nested_records(number: int) -> Any:
    """Return nested records whose type information hasn't been read yet."""
    text = "from __future__ import annotations\nimport msgspec\n"
    for depth in range(DEPTH):
        inner = f"R{depth - 1}" if depth else "int"
        text += f"class R{depth}(msgspec.Struct):\n    a: int\n    b: list[int]\n    c: {inner}\n"
    module = types.ModuleType(f"nested_records_{number}")
    sys.modules[module.__name__] = module
    exec(compile(text, module.__name__, "exec"), vars(module))
    return module


@pytest.mark.usefixtures("frequent_switches")
def test_two_threads_that_meet_a_record_first_both_read_it() -> None:
    value: Any = 1
    for _ in range(DEPTH):
        value = {"a": 1, "b": [1], "c": value}
    payload = msgspec.msgpack.encode(value)
    read: list[Any] = []
    for number in range(60):
        module, begin = nested_records(number), threading.Barrier(2)

        def meet(module: Any = module, begin: threading.Barrier = begin) -> None:
            begin.wait()
            read.append(raw_decoder(vars(module)[f"R{DEPTH - 1}"])(payload))

        threads = [threading.Thread(target=meet) for _ in range(2)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        del sys.modules[module.__name__]
    assert len(read) == 120
    assert all(each.c.c.a == 1 for each in read)
