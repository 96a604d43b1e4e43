"""A parameter server in memory, and the real service with its command line."""

from collections.abc import Iterator

import pytest

from tests.harness.processes import Network
from tests.services.params.cli_harness import SETS, ParameterServiceProcess, RunCommand, param_command
from tests.services.params.parameter_client import arm_announcement, assignments, connected_client
from tests.services.params.server_harness import ServerHarness, server_harness
from tests.services.runtime.conftest import bus as bus
from tests.services.runtime.conftest import clock as clock


@pytest.fixture
def at() -> Iterator[ServerHarness]:
    """A parameter server in memory, to which the arm has announced its set."""
    with server_harness() as made:
        made.server.announce(arm_announcement(fleet=assignments(ref_angle=20), command_line=assignments(tr_Kp=5)))
        yield made


@pytest.fixture(scope="package")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ParameterServiceProcess]:
    """The real service, started once for all files that use the command line."""
    folder = tmp_path_factory.mktemp("param")
    with Network(folder) as network, connected_client(network) as client:
        yield ParameterServiceProcess(network, client, folder)


@pytest.fixture
def param(
    service: ParameterServiceProcess, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[RunCommand]:
    """Run ``elea param VERB ...`` in this process; every set is reset afterwards."""
    run = param_command(service, monkeypatch, capsys)
    yield run
    for name in SETS:
        run("reset", name)
