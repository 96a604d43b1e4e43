"""The supervisor: starts the processes of a fleet in order, monitors them, and stops them without
leaving any behind.
"""
