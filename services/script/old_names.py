"""Gives a script's libraries the names and defaults that they had in ROS 1's time."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

_NUMPY = {
    "float": float,
    "int": int,
    "long": int,
    "complex": complex,
    "object": object,
    "str": str,
    "unicode": str,
}
"""Former names of Python's types in numpy."""
_NUMPY_RENAMED = {
    "float_": "float64",
    "complex_": "complex128",
    "unicode_": "str_",
    "string_": "bytes_",
    "Inf": "inf",
    "Infinity": "inf",
    "infty": "inf",
    "NaN": "nan",
    "round_": "round",
    "product": "prod",
    "in1d": "isin",
    "trapz": "trapezoid",
    "alltrue": "all",
    "sometrue": "any",
}
"""Former names in numpy, and those of today."""


def adapt_numpy(numpy: ModuleType) -> None:
    """Add former names to numpy, and let ``fromstring`` read binary data."""
    names = vars(numpy)
    if "fromstring" not in names:  # a module of the script's own
        return
    former = _NUMPY | {old: getattr(numpy, new) for old, new in _NUMPY_RENAMED.items()}
    names.update({name: value for name, value in former.items() if name not in names})
    read = numpy.fromstring

    def fromstring(string: Any, dtype: Any = float, count: int = -1, sep: str = "", **more: Any) -> Any:
        if sep:
            return read(string, dtype, count, sep=sep, **more)
        data = string.encode() if isinstance(string, str) else string
        return numpy.frombuffer(data, dtype, count).copy()

    names["fromstring"] = fromstring


def adapt_yaml(yaml: ModuleType) -> None:
    """Let ``load`` and ``load_all`` work without a Loader, as in PyYAML 5."""

    if not hasattr(yaml, "FullLoader"):  # a module of the script's own
        return

    def with_default(function: Callable[[Any, Any], Any]) -> Callable[..., Any]:
        return lambda stream, Loader=None: function(stream, Loader or yaml.FullLoader)

    vars(yaml).update({name: with_default(getattr(yaml, name)) for name in ("load", "load_all")})


def tostring(value: Any) -> Any:
    """Return ``value.tostring()``, which arrays of numpy and Python now call ``tobytes``."""
    if hasattr(value, "tobytes") and not hasattr(value, "tostring"):
        return value.tobytes()
    return value.tostring()


ADAPTERS: dict[str, Callable[[ModuleType], None]] = {"numpy": adapt_numpy, "yaml": adapt_yaml}
"""What adapts a library, once, when a script imports it."""
