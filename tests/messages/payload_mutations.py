"""A fully filled payload of each record, and every place in it where a wrong value can be put."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import msgpack
import msgspec.inspect as kinds

from messages.base import Array, Message
from tests.messages.strategies import bare, struct


class MutationPoint(NamedTuple):
    """A place in a payload: its path as in errors, its type, and a function that puts another value there."""

    path: str
    kind: kinds.Type
    with_value: Callable[[Any], Any]


def filled_payload(kind: kinds.Type) -> Any:
    """Return a valid plain value without empty lists, so that every field occurs."""
    match bare(kind):
        case kinds.StructType(fields=fields):
            return {field.encode_name: filled_payload(field.type) for field in fields}
        case kinds.FloatType():
            return 0.5
        case kinds.IntType(le=high):
            return 2 if high is None else min(2, high)
        case kinds.BoolType():
            return True
        case kinds.StrType():
            return "text"
        case kinds.BytesType():
            return b"2x2."  # an image of 2 rows of 2 bytes
        case kinds.LiteralType(values=allowed):
            return allowed[0]
        case kinds.ExtType():
            return msgpack.ExtType(1, msgpack.packb(["<f8", [36], bytes(8 * 36)]))
        case kinds.UnionType(types=types):
            return filled_payload(types[0])
        case kinds.NoneType():
            return None
        case kinds.VarTupleType(item_type=item, min_length=low):
            return [filled_payload(item)] * (low or 2)
        case kinds.CustomType(cls=cls) if issubclass(cls, Array):
            size = int(cls.DTYPE[-1])
            return msgpack.ExtType(1, msgpack.packb([cls.DTYPE, [2], bytes(2 * size)]))
    raise AssertionError(f"no filled value for {kind}")


def mutation_points(record: type[Message]) -> list[MutationPoint]:
    """Return all places in a record's filled payload, the payload itself first."""
    kind = struct(record)
    return list(_mutation_points(kind, filled_payload(kind), "$", lambda value: value))


def _mutation_points(kind: kinds.Type, value: Any, path: str, put: Callable[[Any], Any]) -> Iterator[MutationPoint]:
    kind = bare(kind)
    yield MutationPoint(path, kind, put)
    yield from _nested_points(kind, value, path, put)


def _nested_points(kind: kinds.Type, value: Any, path: str, put: Callable[[Any], Any]) -> Iterator[MutationPoint]:
    """Yield the places below one; for a union, those below each of its types."""
    if isinstance(kind, kinds.StructType):
        for field in kind.fields:
            name = field.encode_name
            yield from _mutation_points(field.type, value[name], f"{path}.{name}", _replacing(put, value, name))
    elif isinstance(kind, kinds.VarTupleType):
        yield from _mutation_points(kind.item_type, value[0], f"{path}[0]", lambda new: put([new, *value[1:]]))
    elif isinstance(kind, kinds.UnionType):
        for each in map(bare, kind.types):
            yield from _nested_points(each, filled_payload(each), path, put)


def _replacing(put: Callable[[Any], Any], value: dict[str, Any], name: str) -> Callable[[Any], Any]:
    return lambda new: put({**value, name: new})
