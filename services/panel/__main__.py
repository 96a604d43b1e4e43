"""`python -m services.panel`."""

from services.panel import SERVICE
from services.runtime.main import main

main(SERVICE)
