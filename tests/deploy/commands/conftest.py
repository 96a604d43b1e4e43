"""A network and a node on it for each test file that requests them."""

from tests.services.conftest import network as network
from tests.services.conftest import node as node
