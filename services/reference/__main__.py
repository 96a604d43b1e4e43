"""`python -m services.reference`."""

from services.reference import SERVICE
from services.runtime.main import main

main(SERVICE)
