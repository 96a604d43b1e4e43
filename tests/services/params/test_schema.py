"""Announcements: checked, merged, and rejected where nodes of a set contradict each other."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from messages.parameters import ParameterDescription
from services.params.schema import ParameterConflict, Schema, validate_announcement
from services.runtime.errors import BadInput
from tests.services.params.parameter_client import ARM_PARAMETERS, arm_announcement, assignments


def one(**given: Any) -> tuple[ParameterDescription, ...]:
    return (ParameterDescription(**{"name": "kp", **given}),)


def test_nodes_of_a_set_add_up_in_the_order_of_their_names() -> None:
    reference = arm_announcement(node="/reference", parameters=ARM_PARAMETERS[:2], fleet=assignments(ref_angle=20))
    controller = arm_announcement(node="/arm", parameters=ARM_PARAMETERS[2:4], command_line=assignments(ss_Kp=1))
    both = [
        Schema().with_node(validate_announcement(a)).with_node(validate_announcement(b))
        for a, b in ((reference, controller), (controller, reference))
    ]
    assert both[0] == both[1]
    assert list(both[0].parameters) == ["ss_Kp", "tr_Kp", "reference_type", "ref_angle"]
    assert both[0].fleet == {"ref_angle": 20.0}
    assert both[0].command_line == {"ss_Kp": 1.0}
    assert both[0].to_message("/robot_control").nodes == ("/arm", "/reference")


def test_the_same_name_needs_the_same_description() -> None:
    schema = Schema().with_node(arm_announcement())
    other = (replace(ARM_PARAMETERS[1], high=45.0), *ARM_PARAMETERS[2:])
    with pytest.raises(
        ParameterConflict, match=r"/reference and /arm describe /robot_control ref_angle differently: high 45"
    ):
        schema.with_node(arm_announcement(node="/reference", parameters=other))
    assert schema.with_node(arm_announcement(parameters=other)).parameters["ref_angle"].high == 45.0


def test_two_fleet_values_for_one_parameter_contradict_each_other() -> None:
    schema = Schema().with_node(arm_announcement(fleet=assignments(ref_angle=10.0)))
    with pytest.raises(ParameterConflict, match=r"as 20\.0 for /reference and as 10\.0 for /arm"):
        schema.with_node(arm_announcement(node="/reference", fleet=assignments(ref_angle=20.0)))


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"set": "arm"}, "absolute name"),
        ({"node": "/a b"}, "a name has letters"),
        ({"parameters": one(name="9x")}, "not a valid parameter name"),
        ({"parameters": one(type="double")}, "has the type 'double'"),
        ({"parameters": one() * 2}, "described twice"),
        ({"parameters": one(low=2, high=1)}, "exclude everything"),
        ({"parameters": one(low=2, high=2, above=True)}, "exclude everything"),
        ({"parameters": one(type="int", low=0.2, high=0.8)}, "exclude everything"),
        ({"parameters": one(type="int", low=0, high=1, above=True, below=True)}, "exclude everything"),
        ({"parameters": one(type="str", low=0)}, "has bounds, but str does not have any"),
        ({"parameters": one(default=7.0, high=5)}, "the default does not fit: kp = 7.0 is out of bounds: at most 5"),
        ({"parameters": one(type="float[]", shortest=(3,), longest=(2,))}, "the lengths of kp exclude everything"),
        ({"parameters": one(shortest=(1,), longest=(2,))}, "has bounds for 2 lengths, which float does not have"),
        ({"parameters": one(at_most="kd")}, "kp is bound to another: unknown parameter 'kd'"),
        ({"parameters": one(excludes=("kd",))}, "kp is bound to another: unknown parameter 'kd'"),
        ({"parameters": (*one(at_most="law"), *one(name="law", type="str"))}, "only numbers have an order"),
        ({"parameters": one(), "fleet": assignments(kpp=1)}, "fleet file: unknown parameter 'kpp'; did you mean 'kp'"),
        ({"parameters": one(high=5), "command_line": assignments(kp=9)}, "command line: kp = 9.0 is out of bounds"),
    ],
)
def test_an_announcement_that_contradicts_itself_is_refused(given: dict[str, Any], says: str) -> None:
    announcement = arm_announcement()
    with pytest.raises(BadInput, match=says):
        validate_announcement(replace(announcement, **given))
