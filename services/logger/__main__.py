"""`python -m services.logger`."""

from services.logger import SERVICE
from services.runtime.main import main

main(SERVICE)
