"""A network and a node of the test's own on it, one for each file of tests that asks for them."""

from tests.services.conftest import network as network
from tests.services.conftest import node as node
