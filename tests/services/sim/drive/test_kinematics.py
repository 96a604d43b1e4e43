"""Wheel geometry: read from a URDF, multiplied, and compared with the configured one."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import WHEELED, urdf_path
from models.dynamics import predict_stop
from models.model import read_model
from models.urdf import NoWheels, read_wheels
from services.sim.drive.kinematics import WheelGeometry, body_velocity, describe_mismatch, rim_speeds

TUTORIAL = WheelGeometry(0.39, 0.15, 0.15)
"""A tutorial's configuration of a Pioneer: a diameter as radius, the width as wheel separation."""


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_there_and_back(v: float, w: float) -> None:
    geometry = WheelGeometry(0.33, 0.1, 0.1)
    assert body_velocity(geometry, *rim_speeds(geometry, v, w)) == pytest.approx((v, w), abs=1e-12)


@pytest.mark.parametrize("name", WHEELED)
def test_every_model_is_what_its_urdf_says(name: str) -> None:
    wheels = read_model(name).wheels
    assert wheels is not None
    pair = read_wheels(urdf_path(name), wheels.left_joint, wheels.right_joint)
    assert pair.left_radius is not None
    assert pair.right_radius is not None
    assert pair.left_offset > 0 > pair.right_offset
    configured = WheelGeometry(wheels.separation, wheels.radius, wheels.radius)
    assert describe_mismatch(configured, WheelGeometry(pair.separation, pair.left_radius, pair.right_radius)) == ""


@pytest.mark.parametrize(
    ("built", "effects"),
    [
        (WheelGeometry(0.316, 0.09, 0.09), ("x0.60", "x0.74", "x1.67", "x1.35")),
        (WheelGeometry(0.33, 0.0975, 0.0975), ("x0.65", "x0.77", "x1.54", "x1.30")),
    ],
)
def test_the_tutorials_figures_are_told_with_their_effects(built: WheelGeometry, effects: tuple[str, ...]) -> None:
    """With the geometry of the URDF that the tutorial drives, and with the real robot's."""
    text = describe_mismatch(TUTORIAL, built)
    drives, turns, way, turn = effects
    assert f"drives {drives} the commanded speed and turns {turns} the commanded rate" in text
    assert f"reports {way} the way and {turn} the turn" in text
    assert "diameter entered as the radius" in text
    assert "bends" not in text


def test_two_percent_are_let_pass() -> None:
    built = WheelGeometry(0.33, 0.0975, 0.0975)
    assert describe_mismatch(WheelGeometry(0.33 * 1.019, 0.0975 * 0.981, 0.0975), built) == ""
    assert "x0.98" in describe_mismatch(WheelGeometry(0.33, 0.0975 * 1.021, 0.0975 * 1.021), built)
    assert "0.3369 m" in describe_mismatch(WheelGeometry(0.33 * 1.021, 0.0975, 0.0975), built)


def test_uneven_wheels_bend_the_way() -> None:
    text = describe_mismatch(WheelGeometry(0.33, 0.0975, 0.0975 / 1.1), WheelGeometry(0.33, 0.0975, 0.0975))
    assert "bends, with the left rim at x1.00 and the right one at x1.10" in text


def test_multipliers_multiply() -> None:
    assert WheelGeometry(0.3, 0.1, 0.1).scaled(1.1, 0.9, 1.2) == WheelGeometry(0.3 * 1.1, 0.1 * 0.9, 0.1 * 1.2)


URDF = """<robot name="r"><link name="base"/>
<link name="l"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="r"><collision><geometry><cylinder radius="0.09" length="0.01"/></geometry></collision></link>
<joint name="to_l" type="continuous"><parent link="base"/><child link="l"/><origin xyz="0.03 0.15 0.1"/></joint>
<joint name="to_r" type="continuous"><parent link="base"/><child link="r"/><origin xyz="-0.01 -0.15 0.07"/></joint>
</robot>"""


def test_the_separation_is_the_distance_of_the_joints_and_the_radius_that_of_the_shape(tmp_path: Path) -> None:
    urdf = tmp_path / "r.urdf"
    urdf.write_text(URDF)
    pair = read_wheels(urdf, "to_l", "to_r")
    assert pair.separation == pytest.approx((0.04**2 + 0.3**2 + 0.03**2) ** 0.5)
    assert (pair.left_radius, pair.right_radius) == (None, 0.09)
    with pytest.raises(NoWheels, match=r"no wheel joint 'left_hub' \(movable: to_l, to_r\)"):
        read_wheels(urdf, "left_hub", "to_r")


@pytest.mark.parametrize(
    ("v", "timeout", "brake", "time", "distance"),
    [
        (0.5, 0.25, 0.3, 1.9167, 0.5417),
        (0.75, 0.25, 0.3, 2.75, 1.125),
        (0.22, 0.25, 1.0, 0.47, 0.0792),
        (-0.5, 0.25, 1.5, 0.5833, 0.2083),
        (0.0, 0.5, 1.0, 0.5, 0.0),
    ],
)
def test_the_theory_of_stopping(v: float, timeout: float, brake: float, time: float, distance: float) -> None:
    assert predict_stop(v, timeout, brake) == pytest.approx((time, distance), abs=1e-4)


@pytest.mark.parametrize(("timeout", "brake"), [(0.25, 0.0), (0.25, -1.0), (-0.1, 1.0)])
def test_a_stop_without_a_brake_has_no_theory(timeout: float, brake: float) -> None:
    with pytest.raises(ValueError, match="a brake above 0"):
        predict_stop(0.5, timeout, brake)
