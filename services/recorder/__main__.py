"""`python -m services.recorder`."""

from services.recorder import SERVICE
from services.runtime.main import main

main(SERVICE)
