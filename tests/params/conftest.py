"""An in-memory network, a clock by hand, a desk in memory, and the real service with its command line."""

from collections.abc import Iterator

import pytest

from tests.params.bench import SETS, Bench, Line, line_of
from tests.params.counter import Counter, counter
from tests.params.sets import arm, asking, values
from tests.processes import Network
from tests.runtime.conftest import bus as bus
from tests.runtime.conftest import clock as clock


@pytest.fixture
def at() -> Iterator[Counter]:
    """A desk in memory, to which the arm has announced its set."""
    with counter() as made:
        made.desk.announce(arm(fleet=values(ref_angle=20), command_line=values(tr_Kp=5)))
        yield made


@pytest.fixture(scope="package")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """The real service, once for all files that ask it from the command line."""
    folder = tmp_path_factory.mktemp("param")
    with Network(folder) as network, asking(network) as client:
        yield Bench(network, client, folder)


@pytest.fixture
def line(bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Line]:
    """``elea param VERB ...`` in this process; every set is as announced before and after."""
    run = line_of(bench, monkeypatch, capsys)
    yield run
    for name in SETS:
        run("reset", name)
