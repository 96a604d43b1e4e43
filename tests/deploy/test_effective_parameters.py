"""The report on a run's parameters: those that differ from the fleet's, and their origins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from deploy.fleet import ChangeConfig, Fleet, RobotConfig, ServiceConfig
from deploy.parameter_sets import SavedParameterNotes, effective_parameters, fleet_values, overridden_parameter_note
from deploy.processes import plan_processes
from deploy.report.record import EffectiveParameter
from deploy.service_parameters import RunOptions
from messages.parameters import Origin, Parameter, ParameterValues

SET = "/r/waypoint"
FLEET = Fleet(
    name="own",
    robot=(
        RobotConfig(
            name="r",
            model="burger",
            parameters={"brake": 1.0},
            services=(ServiceConfig(kind="waypoint", parameters={"max_linear": 0.2, "goals": [[1, 0]]}),),
        ),
        RobotConfig(name="arm", model="arm", parameters={"effort_mode": "sum"}),
    ),
    change=(ChangeConfig(at=1.0, set=SET, values={"tolerance": 0.1}),),
)
OWN = fleet_values(FLEET, plan_processes(FLEET, RunOptions(folder=Path("/tmp/run"))))


def told(**values: tuple[Any, Origin]) -> dict[str, ParameterValues]:
    made = tuple(Parameter(name=name, value=value, origin=origin) for name, (value, origin) in values.items())
    return {SET: ParameterValues(set=SET, values=made)}


def test_the_fleet_s_own_values_are_those_of_its_services_bases_and_joints() -> None:
    assert (OWN[SET]["max_linear"], OWN[SET]["goals"], OWN[SET]["lag"]) == (0.2, ((1.0, 0.0),), 0.2)
    assert (OWN["/r/base"]["brake"], OWN["/r/base"]["cmd_vel_timeout"]) == (1.0, 0.25)
    assert "wheel_radius" not in OWN["/r/base"]
    assert (OWN["/arm/joints"]["effort_mode"], OWN["/arm/joints"]["damping"]) == ("sum", 0.0)
    assert "enable_link_tf" not in OWN["/arm/joints"]
    assert set(OWN) == {"/router", "/sim", "/grader", SET, "/r/base", "/arm/joints"}


def test_a_run_on_the_fleet_s_values_says_nothing() -> None:
    same = told(max_linear=(0.2, "saved"), goals=(((1.0, 0.0),), "fleet"), lag=(0.2, "default"), tolerance=(0.1, "run"))
    assert overridden_parameter_note(same, OWN, FLEET) == ()
    assert list(SavedParameterNotes(lambda: same, OWN).new_lines()) == []
    assert effective_parameters(same, OWN) == {
        SET: {
            "max_linear": EffectiveParameter(value=0.2, origin="saved"),
            "goals": EffectiveParameter(value=((1.0, 0.0),), origin="fleet"),
            "tolerance": EffectiveParameter(value=0.1, origin="run"),
        }
    }


def test_a_run_on_other_values_names_each_with_its_origin_and_the_fleet_s() -> None:
    other = told(max_linear=(0.3, "saved"), lag=(0.5, "run"), law=("tutorial", "command line"))
    (text,) = overridden_parameter_note(other, OWN, FLEET)
    assert f"{SET} max_linear = 0.3 (saved; the fleet's is 0.2)" in text
    assert f"{SET} lag = 0.5 (run; the fleet's is 0.2)" in text
    assert f"{SET} law = tutorial (command line; the fleet's is steady)" in text
    saved = SavedParameterNotes(lambda: other, OWN)
    (line,) = saved.new_lines()
    assert f"{SET} max_linear = 0.3 (saved; the fleet's is 0.2); --no-saved ignores them" in line
    assert list(saved.new_lines()) == []
