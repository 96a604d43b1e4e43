"""``python -m services.params``."""

from services.params import SERVICE
from services.runtime import main

main(SERVICE)
