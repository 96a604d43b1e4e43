"""Finds topics, requests and message types by name, and describes types: fields, units, bounds and texts."""

from __future__ import annotations

import inspect
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, get_origin, get_type_hints

from msgspec import inspect as shapes

from messages.base import LARGEST, Array, Message
from messages.interfaces import catalogue
from messages.interfaces.records import GeneratedMessage, find_record, need_record
from messages.records import RECORDS, UnknownRecord
from messages.requests import REQUESTS, Request
from messages.topics import TOPICS, Topic
from services.runtime.errors import BadInput, nearest
from services.script.workspace import workspace_of


@cache
def use_workspace() -> None:
    """Register the message packages of the workspace around the current directory as well."""
    catalogue().locate = workspace_of(Path.cwd()).package_path


class FieldType(NamedTuple):
    """The type of a field: its ROS name, the record it holds, and its bounds."""

    name: str
    record: type[Message] | None = None
    unit: str = ""
    bounds: str = ""
    choices: tuple[Any, ...] = ()
    optional: bool = False


def find_interface(name: str) -> type[Message] | Request[Any, Any]:
    """Return the record of a ROS type (also ``geometry_msgs/msg/Twist``), or a request by its name; raises BadInput."""
    use_workspace()
    full = name.replace("/msg/", "/", 1).replace("/srv/", "/", 1)
    if (record := find_record(full)) is not None:
        return record
    own = {each.name: each for each in REQUESTS}
    if (request := own.get(f"/{name.lstrip('/')}")) is not None:
        return request
    if (service := service_interface(full)) is not None:
        return service
    short: dict[str, list[str]] = {}
    for each in RECORDS:
        short.setdefault(each.rpartition("/")[2], []).append(each)
    near = short.get(name) or nearest(full, [*RECORDS, *own], 3, cutoff=0.5)
    near = near or [whole for each in nearest(name, short, 2) for whole in short[each]]
    hint = f"did you mean {' or '.join(map(repr, near))}?" if near else "./elea interface list shows all"
    raise BadInput(f"unknown type {name[:80]!r}; {hint}")


def summary(record: type[Message]) -> str:
    """Return the docstring of a record."""
    return inspect.getdoc(record) or ""


def describe_fields(record: type[Message]) -> list[dict[str, Any]]:
    """Describe every field of a record, including nested records: type, unit, bounds and default."""
    info = shapes.type_info(record)
    assert isinstance(info, shapes.StructType)
    rows = []
    for each in info.fields:
        shape = _field_type(each.type)
        rows.append(
            {
                "name": each.encode_name,
                "type": shape.name,
                "unit": shape.unit,
                "bounds": shape.bounds,
                "choices": list(shape.choices),
                "optional": shape.optional,
                "default": None if shape.record or shape.name.endswith("]") else _plain_default(each.default),
                "about": summary(shape.record) if shape.record else "",
                "fields": describe_fields(shape.record) if shape.record else [],
            }
        )
    return rows


def constants(record: type[Message]) -> dict[str, Any]:
    """Return the constants of a record, e.g. ULTRASOUND of sensor_msgs/Range."""
    if issubclass(record, GeneratedMessage):
        try:
            return {each.name: each.value for each in catalogue().message(record.ROS_TYPE, 2).constants}
        except BadInput:  # it was learned from another process, without its constants
            return {}
    hints = get_type_hints(record, include_extras=True)
    names = [name for name, hint in hints.items() if get_origin(hint) is ClassVar or hint is ClassVar]
    return {name: getattr(record, name) for name in names if name.isupper() and name != "ROS_TYPE"}


def describe_type(record: type[Message]) -> dict[str, Any]:
    """Describe a record in full, with the topics and requests that use it."""
    return {
        "type": record.ROS_TYPE,
        "about": summary(record),
        "constants": constants(record),
        "fields": describe_fields(record),
        "topics": [each.name for each in TOPICS if each.record is record],
        "requests": [each.name for each in REQUESTS if record in (each.request_type, each.response_type)],
    }


def list_types(package: str = "") -> dict[str, list[dict[str, str]]]:
    """List all records and requests, or those of a package; raises BadInput for a package that has none."""
    use_workspace()
    records = {name: each for name, each in sorted(RECORDS.items()) if not package or name.startswith(f"{package}/")}
    if package:
        for own in catalogue().types(package, "msg"):
            if (found := find_record(name := f"{package}/{own}")) is not None:
                records.setdefault(name, found)
        records = dict(sorted(records.items()))
    if not records:
        packages = sorted({*(name.partition("/")[0] for name in RECORDS), *catalogue().packages()})
        raise BadInput(f"there are no types in the package {package!r} (known: {', '.join(packages)})")
    messages = [{"type": name, "about": summary(each).partition("\n")[0]} for name, each in records.items()]
    requests = [
        {
            "name": each.name,
            "asks": each.request_type.ROS_TYPE,
            "replies": each.response_type.ROS_TYPE,
            "about": each.about,
        }
        for each in REQUESTS
        if not package or each.request_type.ROS_TYPE in records or each.response_type.ROS_TYPE in records
    ]
    return {"messages": messages, "requests": requests}


def _field_type(kind: shapes.Type) -> FieldType:
    """Describe a type."""
    match kind:
        case shapes.Metadata(type=bare, extra=extra):
            return _field_type(bare)._replace(unit=(extra or {}).get("unit", ""))
        case shapes.BoolType():
            return FieldType("bool")
        case shapes.IntType() | shapes.FloatType():
            return FieldType("int" if isinstance(kind, shapes.IntType) else "float", bounds=_bounds(kind))
        case shapes.StrType(max_length=longest):
            return FieldType("string", bounds=f"at most {longest} characters" if longest is not None else "")
        case shapes.BytesType():
            return FieldType("uint8[]")
        case shapes.LiteralType(values=values):
            return FieldType("string", choices=tuple(values))
        case shapes.StructType(cls=record) if issubclass(record, Message):
            return FieldType(record.ROS_TYPE, record)
        case shapes.CustomType(cls=array) if issubclass(array, Array):
            return FieldType({"<f8": "float64[]", "<f4": "float32[]"}[array.DTYPE])
        case shapes.VarTupleType(item_type=item, min_length=least, max_length=most):
            element = _field_type(item)
            count = f"{most}" if least == most and most else ""
            name = f"({element.name})" if " or " in element.name else element.name
            return element._replace(name=f"{name}[{count}]")
        case shapes.UnionType(types=types):
            return _union_type(types)
        case _:
            return FieldType("any")


def _union_type(types: tuple[shapes.Type, ...]) -> FieldType:
    """Describe a union: null makes it optional; a packed array is shown as its list."""
    alternatives = [_field_type(each) for each in types if not isinstance(each, shapes.NoneType | shapes.ExtType)]
    names = dict.fromkeys(each.name for each in alternatives)
    merged = alternatives[0] if len(alternatives) == 1 else FieldType(" or ".join(names))
    return merged._replace(optional=any(isinstance(each, shapes.NoneType) for each in types))


def _bounds(kind: shapes.IntType | shapes.FloatType) -> str:
    low = kind.ge if kind.ge is not None else kind.gt
    high = kind.le if kind.le is not None else kind.lt
    if (low, high) == (-LARGEST, LARGEST):
        return "finite"
    if low is not None and high is not None:
        over, under = " (exclusive)" if kind.gt is not None else "", " (exclusive)" if kind.lt is not None else ""
        return f"{low}{over} to {high}{under}"
    if low is not None:
        return f"{'above' if kind.gt is not None else 'at least'} {low}"
    return f"{'below' if kind.lt is not None else 'at most'} {high}" if high is not None else ""


def _plain_default(value: Any) -> Any:
    """Return a default as plain data; None if there is none to show."""
    return value if isinstance(value, bool | int | float | str) else None


def known_topic(name: str) -> Topic[Any] | None:
    """Return the topic called ``name`` in some namespace; of several, the one with the longest name."""
    found = [each for each in TOPICS if name == each.name or name.endswith("/" + each.name.lstrip("~/"))]
    fitting = [each for each in found if not each.name.startswith("/") or each.name == name]
    return max(fitting, key=lambda each: len(each.name), default=None)


def known_request(name: str, asks: str) -> Request[Any, Any] | None:
    """Return the request with an absolute name that takes the type ``asks``; a relative one, or one of a node
    (``~name``), may be in any namespace.
    """
    for each in REQUESTS:
        placed = each.name.startswith("/")
        fits = name == each.name if placed else name.endswith(f"/{each.name.removeprefix('~')}")
        if fits and asks == each.request_type.ROS_TYPE:
            return each
    return None


def known_record(type_name: str) -> type[Message] | None:
    """Return the record of a ROS type in either spelling, or None if this project has none."""
    return find_record(canonical_type(type_name))


def record_by_type(type_name: str) -> type[Message]:
    """Return the record of a ROS type in either spelling; raises BadInput with the nearest name."""
    use_workspace()
    try:
        return need_record(canonical_type(type_name))
    except UnknownRecord as error:
        raise BadInput(str(error)) from None


def service_interface(type_name: str) -> Request[Any, Any] | None:
    """Return the records of a service type (``std_srvs/SetBool``) as a request under the type's name, or None."""
    name = canonical_type(type_name)
    asks, replies = find_record(f"{name}Request"), find_record(f"{name}Response")
    return None if asks is None or replies is None else Request(name, asks, replies, "a service type")


def canonical_type(type_name: str) -> str:
    """Return the type as ``geometry_msgs/Twist``, without the ``msg`` or ``srv`` that ROS 2 puts in the middle."""
    parts = type_name.split("/")
    return "/".join((parts[0], parts[2])) if len(parts) == 3 and parts[1] in ("msg", "srv") else type_name
