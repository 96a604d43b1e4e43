"""The base class of services' parameters, and the declaration of a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, TypeVar, dataclass_transform, get_args

import msgspec
from msgspec import Meta

T = TypeVar("T")


class _Declaration(NamedTuple):
    default: Any
    meta: Meta


def param(
    default: T,
    low: float | None = None,
    high: float | None = None,
    unit: str = "",
    text: str = "",
    *,
    live: bool = True,
    level: int = 1,
    at_most: str = "",
    excludes: Sequence[str] = (),
    max_length: int | None = None,
) -> T:
    """Declare a parameter: ``speed: float = param(0.2, 0.0, 1.0, "m/s", "Top speed.")`` in a Parameters class.

    Args:
        default: the default value.
        low: the lowest allowed number.
        high: the highest allowed number.
        unit: the unit of a number, such as "m/s".
        text: the description in the help and the panel.
        live: whether a running service applies its changes.
        level: the bit of ``Context.params_changed`` that is set when it changes.
        at_most: the name of a parameter that bounds it from above.
        excludes: the names of parameters that must be null or false while this one is not.
        max_length: maximum characters of a text, or items of a list.
    """
    extra: dict[str, Any] = {"unit": unit} if unit else {}
    extra |= {} if live else {"live": False}
    extra |= {} if level == 1 else {"level": level}
    extra |= {"at_most": at_most} if at_most else {}
    extra |= {"excludes": tuple(excludes)} if excludes else {}
    bounds = {"ge": low, "le": high, "max_length": max_length, "description": text or None, "extra": extra or None}
    meta: Meta = Meta(**bounds)  # type: ignore[arg-type]  # its stub has an overload for each kind of bound
    return _Declaration(default, meta)  # type: ignore[return-value]  # ParametersType puts the default in its place


def _annotated(hint: Any, meta: Meta) -> Any:
    """Annotate a type hint with ``meta``; in an optional one, the type other than None."""
    if isinstance(hint, str):
        text = hint.removesuffix("None").rstrip().removesuffix("|")
        return Annotated[hint, meta] if text in (hint, "") else Annotated[text.strip(), meta] | None
    if isinstance(hint, UnionType):
        (inner,) = (each for each in get_args(hint) if each is not NoneType)
        return Annotated[inner, meta] | None
    return Annotated[hint, meta]


class ParametersType(msgspec.StructMeta):
    """Turns ``x: float = param(...)`` into msgspec's ``x: Annotated[float, Meta(...)] = default``.

    All records of parameters are frozen and keyword-only.
    """

    def __new__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **options: Any) -> ParametersType:
        hints = namespace.get("__annotations__", {})
        for field, value in namespace.items():
            if isinstance(value, _Declaration):
                hints[field] = _annotated(hints[field], value.meta)
                namespace[field] = value.default
        return super().__new__(cls, name, bases, namespace, **{"frozen": True, "kw_only": True, **options})


@dataclass_transform(frozen_default=True, kw_only_default=True)
class Parameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, metaclass=ParametersType):
    """The parameters of a service: a flat record of bool, int, float, str or tuples of them.

    Each is declared with ``param``, or, for features that it lacks, such as an exclusive bound, with
    ``Annotated[float, Meta(gt=0, description=..., extra={"unit": "m"})]``; ``extra`` may have ``unit``, ``live``,
    ``level``, ``at_most`` and ``excludes``, as in ``param``. Bounds and relations are checked before a change applies.
    """
