"""`python -m services.player`."""

from services.player import SERVICE
from services.runtime.main import main

main(SERVICE)
