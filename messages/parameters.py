"""elea_msgs of the parameter service: parameter sets, their descriptions and values, and requests to change them."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Finite, Message, NameStr
from messages.std import Time

Int64 = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
Scalar = bool | Int64 | Finite | Annotated[str, Meta(max_length=65_536)] | None
_Scalars = Annotated[tuple[Scalar, ...], Meta(max_length=10_000)]
Value = Scalar | Annotated[tuple[Scalar | _Scalars, ...], Meta(max_length=10_000)]
"""A parameter's value: a scalar, a list of scalars, or a list of such lists, each of at most 10,000 items."""

Origin = Literal["default", "fleet", "saved", "command line", "run"]
"""Origin of a value; a later one in this list takes precedence. ``run`` values apply to this run only and are never
saved."""

SetName = Annotated[str, Meta(max_length=255)]
RequestId = Annotated[str, Meta(max_length=64)]
Who = Annotated[str, Meta(max_length=255)]


class ParameterDescription(Message, frozen=True, kw_only=True):
    """One parameter: its type, default, bounds, choices, unit and text.

    ``choice_values`` are the values that the choices name, as text and in the same order, if the choices are names; a
    choice may then be given by its name or its value.

    ``type`` is ``bool``, ``int``, ``float``, ``str``, or one of these followed by ``[]`` or ``[][]``; ``optional``
    allows null. ``low`` and ``high`` are inclusive unless ``above`` and ``below`` exclude them. ``shortest`` and
    ``longest`` bound the number of items at each level of a list, outermost first, then the characters of a text; 0
    means unbounded. ``at_most`` names another parameter of the set that this one may not exceed; ``excludes`` names
    those that must be off (null or false) while this one is on. A ``live`` parameter can change while its service runs;
    others are set by the fleet file or the command line. ``level`` is the bit mask passed to subscribers when it
    changes, as in dynamic_reconfigure.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterDescription"
    name: NameStr = ""
    type: NameStr = "float"
    default: Value = None
    low: Finite | None = None
    high: Finite | None = None
    above: bool = False
    below: bool = False
    choices: tuple[str, ...] = ()
    choice_values: tuple[str, ...] = ()
    shortest: tuple[Count, ...] = ()
    longest: tuple[Count, ...] = ()
    at_most: NameStr = ""
    excludes: Annotated[tuple[NameStr, ...], Meta(max_length=100)] = ()
    optional: bool = False
    unit: str = ""
    text: str = ""
    live: bool = True
    level: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 1


class ParameterSchema(Message, frozen=True, kw_only=True):
    """The descriptions of a set, latched on ``<set>/parameter_descriptions``; ``nodes`` are those that announced it."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterSchema"
    set: SetName = ""
    nodes: tuple[str, ...] = ()
    parameters: tuple[ParameterDescription, ...] = ()


class Parameter(Message, frozen=True, kw_only=True):
    """One effective value and its origin."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Parameter"
    name: str = ""
    value: Value = None
    origin: Origin = "default"


class ParameterValues(Message, frozen=True, kw_only=True):
    """All effective values of a set, latched on ``<set>/parameter_updates`` at each change.

    ``revision`` increases with every change; ``level`` is the union of the levels of the changed parameters, all ones
    at first. ``note`` says which values were clamped, converted or dropped, and why.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterValues"
    set: SetName = ""
    revision: Count = 0
    level: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 2**32 - 1
    values: tuple[Parameter, ...] = ()
    note: str = ""


class Assignment(Message, frozen=True, kw_only=True):
    """A name and a value."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Assignment"
    name: NameStr = ""
    value: Value = None


Assignments = Annotated[tuple[Assignment, ...], Meta(max_length=MOST_ITEMS)]


class Announcement(Message, frozen=True, kw_only=True):
    """Announces the parameters that a node has in a set, and their values from its fleet file and command line.

    ``run`` are values that were set for this run only, kept across restarts of the parameter service. With ``leaves``,
    the node stops following the set instead, as when a robot leaves the world.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/Announcement"
    set: SetName = ""
    node: NameStr = ""
    parameters: Annotated[tuple[ParameterDescription, ...], Meta(max_length=MOST_ITEMS)] = ()
    fleet: Assignments = ()
    command_line: Assignments = ()
    run: Assignments = ()
    leaves: bool = False


class ScheduledChange(Message, frozen=True, kw_only=True):
    """A due change of the run's schedule: ``number`` is its index, from 0, in order of time.

    ``time`` is the simulation time at which it was applied or refused; ``reason`` explains a refusal.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/ScheduledChange"
    number: Count = 0
    made: bool = False
    time: Time = Time()
    reason: str = ""


class ScheduledChanges(Message, frozen=True, kw_only=True):
    """The due scheduled changes of a run in this ``epoch``, applied or refused."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ScheduledChanges"
    epoch: Count = 0
    changes: tuple[ScheduledChange, ...] = ()


class ParameterSet(Message, frozen=True, kw_only=True):
    """The name of a set of parameters."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterSet"
    set: SetName = ""


class ParameterSets(Message, frozen=True, kw_only=True):
    """The descriptions of all parameter sets."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterSets"
    sets: tuple[ParameterSchema, ...] = ()


class SetParameters(Message, frozen=True, kw_only=True):
    """Change several parameters of a set, all or none.

    ``clamp`` replaces a number out of bounds by the bound instead of refusing it. ``id`` identifies the request:
    repeated with the same ID, it is not applied again. ``run`` makes the change for this run only, without saving it.
    ``kind`` is its label in the history.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetParameters"
    set: SetName = ""
    values: Assignments = ()
    clamp: bool = False
    run: bool = False
    kind: Literal["set", "load"] = "set"
    id: RequestId = ""
    who: Who = ""


class ResetParameters(Message, frozen=True, kw_only=True):
    """Reset the named parameters, or all if none is named, to their values from the fleet file or the defaults."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ResetParameters"
    set: SetName = ""
    names: Annotated[tuple[NameStr, ...], Meta(max_length=MOST_ITEMS)] = ()
    id: RequestId = ""
    who: Who = ""


class UndoParameters(Message, frozen=True, kw_only=True):
    """Undo the newest change of a set that is not undone yet, or the one that created ``revision``.

    For an older change, only parameters that no later change has touched are restored. Undoing a change twice has no
    effect.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/UndoParameters"
    set: SetName = ""
    revision: Count = 0
    id: RequestId = ""
    who: Who = ""


class ParameterChange(Message, frozen=True, kw_only=True):
    """One change in the history: who made it, when (wall time and simulation time), the values before and after.

    ``run`` marks an unsaved change for one run; ``undone`` one that was undone.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterChange"
    set: SetName = ""
    revision: Count = 0
    kind: Literal["set", "reset", "undo", "load", "migrated"] = "set"
    who: Who = ""
    wall_time: Count = 0
    sim_time: Time = Time()
    before: tuple[Assignment, ...] = ()
    after: tuple[Assignment, ...] = ()
    run: bool = False
    undone: bool = False


class HistoryOf(Message, frozen=True, kw_only=True):
    """Get the newest changes of a set, or of all sets if it is empty."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/HistoryOf"
    set: SetName = ""
    limit: Annotated[int, Meta(ge=1, le=10_000)] = 100


class ParameterHistory(Message, frozen=True, kw_only=True):
    """Changes, newest first."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ParameterHistory"
    changes: tuple[ParameterChange, ...] = ()
