"""Fleet files: values are parsed with their types, and mistakes are reported with their line."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from deploy.fleet_file import find_fleet, fleet_names, parse_fleet, read_fleet, saved_parameters_file
from deploy.service_parameters import NodeGroups, RunOptions, service_parameters
from services.runtime.errors import BadInput

FILE = """\
name = "pair"
[run]
mode = "real"
factor = 2
[[robot]]
name = "a"
model = "burger"
pose = { x = 1, y = 0.5, yaw = 1.57 }
[[robot]]
name = "b"
model = "waffle"
parameters = { cmd_vel_timeout = 0.5 }
[[robot.services]]
kind = "waypoint"
name = "driver"
parameters.laps = 2
parameters.goals = [
  [1, 2],
  [3, 4],
]
[[every_robot]]
kind = "waypoint"
from_start = ["goals"]
parameters = { goals = [[5, 0]], max_linear = 0.1 }
[[service]]
kind = "logger"
restart = { when = "always", limit = 2 }
[bounds]
cross_track_max_m = 0.1
"""


def refusal(old: str, new: str) -> str:
    """Return the error message after a change to FILE."""
    assert old in FILE
    with pytest.raises(BadInput) as caught:
        parse_fleet(Path("pair.toml"), FILE.replace(old, new, 1))
    return str(caught.value)


def test_values_arrive() -> None:
    fleet = parse_fleet(Path("pair.toml"), FILE)
    assert (fleet.run.mode, fleet.run.factor, fleet.run.port) == ("real", 2.0, 7447)
    assert [robot.name for robot in fleet.robot] == ["a", "b"]
    assert fleet.robot[0].pose.yaw == 1.57
    assert fleet.robot[1].services[0].parameters == {"laps": 2, "goals": [[1, 2], [3, 4]]}
    assert fleet.bounds == {"cross_track_max_m": 0.1}


@pytest.mark.parametrize(
    ("old", "new", "place", "hint"),
    [
        ("factor = 2", "facter = 2", 4, "did you mean 'factor'"),
        ('model = "waffle"', 'model = "wafle"', 11, "did you mean 'waffle'"),
        ('model = "burger"', "modell = 1", 7, "did you mean 'model'"),
        ('model = "burger"', 'world = "empty"', 7, "as a key of the fleet it goes above the first [table]"),
        ("yaw = 1.57", "jaw = 1.57", 8, "did you mean 'yaw'"),
        ("[[service]]", "[[servise]]", 25, "did you mean 'service'"),
        ('kind = "logger"', 'kind = "loger"', 26, "did you mean 'logger'"),
        ("parameters.laps", "parameters.lap", 16, "did you mean 'laps'"),
        ("max_linear = 0.1", "max_liner = 0.1", 24, "did you mean 'max_linear'"),
        ("cmd_vel_timeout", "cmd_timeout", 12, "did you mean 'cmd_vel_timeout'"),
        ("limit = 2", "limits = 2", 27, "did you mean 'limit'"),
        ("cross_track_max_m", "cross_track_mx_m", 29, "did you mean 'cross_track_max_m'"),
        ('model = "waffle"', 'model = "waffle"\nreference = { topik = "x" }', 12, "did you mean 'topic'"),
        ("[bounds]", "[bounds.reel]", 28, "did you mean 'real'"),
        ("[bounds]", "[mode_bounds.real]", 28, "unknown key 'mode_bounds'"),
        ("[bounds]", "[bounds.real]\ncollision = 0", 29, "did you mean 'collisions'"),
    ],
)
def test_wrong_name(old: str, new: str, place: int, hint: str) -> None:
    text = refusal(old, new)
    assert text.startswith(f"pair.toml:{place}: ")
    assert hint in text


@pytest.mark.parametrize(
    ("old", "new", "place", "what"),
    [
        ('mode = "real"', 'mode = "reel"', 3, "run.mode: 'reel' is not one of lockstep, real; did you mean 'real'?"),
        ('when = "always"', 'when = "alway"', 27, "restart.when: 'alway' is not one of always, never, on-failure"),
        ('mode = "real"', 'mode = "free"', 3, "Use lockstep: it runs as fast as the machine can"),
        ("factor = 2", "factor = 0", 4, "run.factor"),
        ("factor = 2", "factor = nan", 4, "run.factor"),
        ("x = 1,", 'x = "1",', 8, "robot[0].pose.x"),
        ("yaw = 1.57", "yaw = 90", 8, "robot[0].pose.yaw: 90 rad is more than a whole turn, 6.28: angles are in rad"),
        ("yaw = 1.57", "yaw = -inf", 8, "robot[0].pose.yaw: Expected `float` >= -6.3"),
        ("parameters.laps = 2", "parameters.laps = -2", 16, "laps"),
        ("[3, 4],", '[3, "four"],', 17, "goals"),
        ("max_linear = 0.1", "max_linear = 1e9", 24, "max_linear"),
        ("cmd_vel_timeout = 0.5", "cmd_vel_timeout = -1", 12, "cmd_vel_timeout"),
        ("limit = 2", 'limit = "two"', 27, "service[0].restart.limit"),
        ('from_start = ["goals"]', 'from_start = ["max_linear"]', 23, "list of points"),
        ('name = "b"\n', "", 9, "name"),
    ],
)
def test_wrong_value(old: str, new: str, place: int, what: str) -> None:
    text = refusal(old, new)
    assert text.startswith(f"pair.toml:{place}: ")
    assert what in text


@pytest.mark.parametrize(
    ("old", "new", "place", "what"),
    [
        ('name = "b"', 'name = "a"', 10, "already a robot 'a'"),
        ('name = "b"', 'name = "3b"', 10, "does not start with a digit"),
        ('name = "driver"', "", 13, "/b/waypoint is already stated"),
        ('name = "b"', 'name = "b"\nnamespace = "a"', 10, "the namespace /a is that of a already"),
        ('name = "b"', 'name = "b"\nframe_prefix = "a/"', 10, "a has the frame a/"),
        ('name = "b"', 'name = "b"\nframe_prefix = "/b"', 10, "a frame has no leading slash"),
        (
            'kind = "logger"',
            'kind = "logger"\nname = "base"\nnamespace = "b"',
            25,
            "/b/base is the parameter set of the robot b",
        ),
        ('kind = "logger"', 'kind = "logger"\nremap = { "*" = "x" }', 27, "wildcards are not allowed"),
        ('kind = "logger"', 'kind = "logger"\nfrom_start = ["x"]', 27, "needs a robot"),
        ('kind = "logger"', 'kind = "logger"\nmodels = ["burger"]', 27, "only for [[every_robot]]"),
        ('from_start = ["goals"]', 'models = ["waffle_pi"]', 23, "unknown model 'waffle_pi'"),
        ('kind = "logger"\n', 'kind = "sim"\nname = "world"\n', 25, "cannot be renamed"),
        ('mode = "real"', 'ends = "duration"', 3, "needs a duration"),
        ("factor = 2", "factor = ", 4, "not TOML"),
        ("parameters = { cmd_vel_timeout = 0.5 }", 'reference = { topic = "wanted" }', 12, "is not an arm"),
    ],
)
def test_contradiction(old: str, new: str, place: int, what: str) -> None:
    text = refusal(old, new)
    assert f"pair.toml:{place}: " in text
    assert what in text


def test_a_number_of_too_many_digits_is_refused() -> None:
    assert refusal("factor = 2", f"factor = {'2' * 5000}").startswith("pair.toml: this is not TOML: Exceeds the limit")
    with pytest.raises(BadInput, match="factor"):
        parse_fleet(Path("pair.toml"), FILE, [f"run.factor={'2' * 5000}"])


def test_bounds_of_a_mode_take_the_place_of_those_of_all() -> None:
    text = FILE.replace("[bounds]", "[bounds]\nrestarts = 0\n[bounds.real]\nrestarts = 2\n[bounds.lockstep]")
    fleet = parse_fleet(Path("pair.toml"), text)
    assert (fleet.run.mode, fleet.active_bounds()) == ("real", {"restarts": 2})
    stepped = msgspec.structs.replace(fleet, run=msgspec.structs.replace(fleet.run, mode="lockstep"))
    assert stepped.active_bounds() == {"restarts": 0, "cross_track_max_m": 0.1}


CHANGE = """[[change]]
at = 2.5
set = "/b/driver"
values = { max_linear = 0.2, goals = [[1, 1]] }
[[change]]
at = 3
set = "/a/base"
values = { "linear.max_velocity" = 0.2, brake = 1 }
[bounds]"""


def test_changes_arrive_and_become_the_schedule_of_the_parameter_service() -> None:
    fleet = parse_fleet(Path("pair.toml"), FILE.replace("[bounds]", CHANGE))
    assert [(each.at, each.set) for each in fleet.change] == [(2.5, "/b/driver"), (3.0, "/a/base")]
    assert service_parameters("params", fleet, RunOptions(folder=Path("/tmp/run")), NodeGroups()) == {
        "file": "",
        "schedule": [
            {"at": 2.5, "set": "/b/driver", "values": {"max_linear": 0.2, "goals": [[1, 1]]}},
            {"at": 3.0, "set": "/a/base", "values": {"linear.max_velocity": 0.2, "brake": 1}},
        ],
        "schedule_file": "/tmp/run/schedule.json",
    }


@pytest.mark.parametrize(
    ("old", "new", "place", "what"),
    [
        ("at = 2.5", "at = -1", 29, "change[0].at"),
        ("at = 2.5", "att = 1", 29, "did you mean 'at'"),
        ('"/b/driver"', '"/b/drive"', 30, "unknown set of parameters '/b/drive'; did you mean '/b/driver'"),
        ("{ max_linear = 0.2, goals = [[1, 1]] }", "{}", 28, "a change without values"),
        ("max_linear = 0.2", "max_liner = 0.2", 31, "did you mean 'max_linear'"),
        ("max_linear = 0.2", "max_linear = 9", 31, "max_linear = 9: Expected `float` <= 2.0"),
        ("max_linear = 0.2", "max_linear = nan", 31, "max_linear = nan: a number that is not finite"),
        ("[[1, 1]]", '[[1, "x"]]', 31, "goals"),
        ('"linear.max_velocity" = 0.2', '"linear.max_velocty" = 0.2', 35, "did you mean 'linear.max_velocity'"),
        ("brake = 1", "wheel_radius = 1", 35, "wheel_radius cannot change while its service runs"),
        ("brake = 1", "brake = 0", 35, "brake = 0"),
    ],
)
def test_a_change_that_no_set_can_take(old: str, new: str, place: int, what: str) -> None:
    assert old in CHANGE
    with pytest.raises(BadInput) as caught:
        parse_fleet(Path("pair.toml"), FILE.replace("[bounds]", CHANGE.replace(old, new, 1)))
    assert str(caught.value).startswith(f"pair.toml:{place}: ")
    assert what in str(caught.value)


def test_unknown_fleet_names_the_nearest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput, match=r"unknown fleet 'lap'; did you mean 'lab'.*your own by its path.*\./lap\.toml"):
        find_fleet("lap")
    (tmp_path / "pair.toml").touch()
    with pytest.raises(BadInput, match=r"no fleet file .*piar\.toml; did you mean 'pair\.toml'"):
        find_fleet(str(tmp_path / "piar.toml"))
    with pytest.raises(BadInput, match=r"no fleet file ./mine\.toml"):
        find_fleet("./mine.toml")
    monkeypatch.chdir(tmp_path)
    for name in ("pair.tml", "pair", "piar.toml"):
        with pytest.raises(BadInput, match=r"there is no fleet.*; did you mean 'pair\.toml'\?"):
            find_fleet(name)
    with pytest.raises(BadInput, match=r"unknown fleet 'lap'; did you mean 'lab'"):
        find_fleet("lap")


def test_renamed_fleets_and_choices_are_refused_with_their_new_names() -> None:
    with pytest.raises(BadInput, match="the fleet arm_seed is called arm_tutorial now"):
        find_fleet("arm_seed")
    for name in ("arm_tutorial", "square_tutorial"):
        text = find_fleet(name).read_text().replace('law = "tutorial"', 'law = "seed"')
        with pytest.raises(BadInput, match=r"x\.toml:\d+: parameter law = 'seed': it is called 'tutorial' now"):
            parse_fleet(Path("x.toml"), text)


def test_parameters_saved_under_the_old_name_of_a_fleet_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "params").mkdir()
    assert saved_parameters_file("arm_tutorial") == Path("params/arm_tutorial.db")
    (tmp_path / "params/arm_seed.db").touch()
    assert saved_parameters_file("arm_tutorial") == Path("params/arm_seed.db")
    (tmp_path / "params/arm_tutorial.db").touch()
    assert saved_parameters_file("arm_tutorial") == Path("params/arm_tutorial.db")


def test_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="cannot be read"):
        read_fleet(tmp_path / "x.toml")


def test_every_fleet_of_the_project_is_good() -> None:
    assert {"lab", "bare", "square", "square_tutorial"} <= set(fleet_names())
    for name in fleet_names():
        assert read_fleet(find_fleet(name)).name == name
