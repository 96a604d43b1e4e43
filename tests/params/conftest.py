"""An in-memory network and a clock by hand."""

from tests.runtime.conftest import bus as bus
from tests.runtime.conftest import clock as clock
