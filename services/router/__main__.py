"""``python -m services.router``."""

from services.router import SERVICE
from services.runtime import main

main(SERVICE)
