"""The fleet files of these tests; services named after a file in ``services`` are the faulty ones there."""

FLEET_HEADER = """
name = "faults"
[run]
mode = "real"
ends = "never"
topology = "{topology}"
"""


def robot_table(number: int, services: str) -> str:
    """A robot that faces along x, one metre beside its neighbours."""
    place = f"pose = {{ y = {number}.0 }}"
    return f'\n[[robot]]\nname = "tb3_{number}"\nmodel = "burger"\n{place}\nservices = [{services}]\n'


def waypoint_entry(number: int) -> str:
    """The project's controller, with a goal so far away that it drives for as long as a test runs."""
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
    + '\n[[service]]\nkind = "sim"\nrestart = { first = 2.0 }\n'
)
"""A robot with the project's controller, and three with controllers that hang when told; a sim that comes back late."""

STAR = (
    FLEET_HEADER.format(topology="star")
    + robot_table(0, waypoint_entry(0))
    + robot_table(1, "")
    + '\n[[service]]\nkind = "router"\nrestart = { when = "always", first = 1.0 }\n'
)
"""Everything through the router, which comes back late; the second robot waits for the test to drive it."""

FIRST_PAUSE_S = 0.05
"""Before the first restart of the service that ends at once [s]."""
BROKEN = (
    FLEET_HEADER.format(topology="direct")
    + robot_table(0, waypoint_entry(0))
    + "".join(_service(f"raise_in_{place}") for place in ("loop", "thread", "timer", "answer"))
    + _service("crash_at_once", f"restart = {{ first = {FIRST_PAUSE_S} }}")
)
"""A robot that must not mind, beside services that raise when told and one that cannot start."""

FAMILY = FLEET_HEADER.format(topology="direct") + robot_table(0, waypoint_entry(0)) + _service("parent")
"""A robot, and a service with a child of its own."""

HOPELESS = FLEET_HEADER.format(topology="direct") + _service(
    "crash_at_once", "required = true\nrestart = { first = 0.05, longest = 0.1, limit = 2 }"
)
"""It cannot do without what cannot start."""

UNFIT = FLEET_HEADER.format(topology="direct") + _service("bad_input", "required = true")
"""It cannot do without what was told something wrong."""
