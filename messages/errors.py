"""The roots of the tree of errors, which services/runtime/errors.py draws as a whole."""


class EleaError(Exception):
    """Anything that this project raises on purpose."""


class BadInput(EleaError, ValueError):
    """Something from outside is wrong: the text says what, where, the limit and the likely cause."""
