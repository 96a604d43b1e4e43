"""The base class of every service's parameters."""

from __future__ import annotations

import msgspec


class Parameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The parameters of a service: a flat record of bool, int, float, str or tuples of them.

    Types carry bounds, unit and text: ``Annotated[float, Meta(ge=0, le=5, description=..., extra={"unit": "m"})]``.
    ``extra`` also marks with ``"live": False`` what a running service does not follow, and gives with ``"level": 2``
    the bit of ``Context.params_changed`` that is set when it changes. ``"at_most": "fast"`` keeps a number below
    another one, and ``"excludes": ("a", "b")`` says what must be null or false while this is not; both are checked
    before a change counts.
    """
