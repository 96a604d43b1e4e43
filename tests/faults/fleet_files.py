"""The fleet files of these tests; services named after a file in ``services`` are faulty ones from there."""

FLEET_HEADER = """
name = "faults"
[run]
mode = "real"
ends = "never"
topology = "{topology}"
"""


def robot_table(number: int, services: str) -> str:
    """Return the table of a robot that faces along x, one metre beside its neighbours."""
    place = f"pose = {{ y = {number}.0 }}"
    return f'\n[[robot]]\nname = "tb3_{number}"\nmodel = "burger"\n{place}\nservices = [{services}]\n'


def waypoint_entry(number: int) -> str:
    """Return an entry of the waypoint controller with a goal so far away that it drives throughout a test."""
    return f'{{ kind = "waypoint", parameters = {{ goals = [[1000.0, {number}.0]] }} }}'


def _faulty(name: str) -> str:
    return f'{{ kind = "waypoint", name = "{name}" }}'


def _service(name: str, rest: str = "") -> str:
    return f'\n[[service]]\nkind = "waypoint"\nname = "{name}"\n{rest}\n'


DRIVING = (
    FLEET_HEADER.format(topology="direct")
    + robot_table(0, waypoint_entry(0))
    + "".join(robot_table(number, _faulty(name)) for number, name in enumerate(("deadlock", "spin", "gil"), 1))
    + _service("timekeeper")
    + '\n[[service]]\nkind = "sim"\nrestart = { first = 4.0 }\n'
)
"""A robot with the waypoint controller, three with controllers that hang on request, and a sim that restarts late."""

STAR = (
    FLEET_HEADER.format(topology="star")
    + robot_table(0, waypoint_entry(0))
    + robot_table(1, "")
    + '\n[[service]]\nkind = "router"\nrestart = { when = "always", first = 1.0 }\n'
)
"""All traffic through the router, which restarts late; the test drives the second robot."""

FIRST_PAUSE_S = 0.05
"""Pause before the first restart of the service that exits at once [s]."""
WINDOW_S = 600.0
"""Time [s] within which its restarts count together, however slowly it starts on a busy machine."""
BROKEN = (
    FLEET_HEADER.format(topology="direct")
    + robot_table(0, waypoint_entry(0))
    + "".join(_service(f"raise_in_{place}") for place in ("loop", "thread", "timer", "answer"))
    + _service("crash_at_once", f"restart = {{ first = {FIRST_PAUSE_S}, window = {WINDOW_S} }}")
)
"""A robot that must not be affected, services that raise on request, and one that can't start."""

FAMILY = FLEET_HEADER.format(topology="direct") + robot_table(0, waypoint_entry(0)) + _service("parent")
"""A robot, and a service with a child process."""

HOPELESS = FLEET_HEADER.format(topology="direct") + _service(
    "crash_at_once", "required = true\nrestart = { first = 0.05, longest = 0.1, limit = 2 }"
)
"""A fleet that requires a service that can't start."""

UNFIT = FLEET_HEADER.format(topology="direct") + _service("bad_input", "required = true")
"""A fleet that requires a service with bad input."""
