"""`python -m services.arm`."""

from services.arm import SERVICE
from services.runtime.main import main

main(SERVICE)
