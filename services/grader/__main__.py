"""`python -m services.grader`."""

from services.grader import SERVICE
from services.runtime.main import main

main(SERVICE)
