"""tf.transformations: every function against values of ROS 1's own, and all conventions of Euler angles."""

from __future__ import annotations

import importlib.util
import math
import random
import subprocess
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from services.runtime.process import ROOT

FILE = ROOT / "services/ros1/site-packages/tf/transformations.py"
Q, P = [0.1, -0.5, 0.3, 0.8], [0.6, 0.2, -0.7, 0.33]
PARTS = [1, 2, 0.5], [0.1, -0.2, 0.3], [0.4, -0.7, 1.3], [4, 5, 6], [0.01, -0.02, 0.03, 1]
POINTS = [[0, 1, 2, 3], [1, 0, 2, -1], [0, 0, 1, 5]]
MOVED = [[1, 2, 2, 4], [1, 1, 2, -1], [0, 3, 1, 5]]

EULER = {
    # convention: quaternion_from_euler(0.4, -0.7, 1.3), euler_from_quaternion(Q)
    "sxyz": ([0.3519493451, -0.1545914158, 0.6113953709, 0.691685516], [-0.289503672, -1.0525452731, 0.8865015351]),
    "sxyx": ([0.7057323123, -0.3087613371, -0.149148728, 0.6199701582], [-2.4768181588, 1.2523079525, 2.7255281479]),
    "sxzy": ([-0.0548117866, 0.5029316952, -0.380476695, 0.7741400795], [0.527287047, 0.3939495163, -1.2248290542]),
    "sxzx": ([0.7057323123, 0.149148728, -0.3087613371, 0.6199701582], [2.2355708216, -1.2523079525, -1.9868608325]),
    "syzx": ([0.6113953709, 0.3519493451, -0.1545914158, 0.691685516], [-1.1740876639, 0.6259390945, -0.1753942205]),
    "syzy": ([-0.149148728, 0.7057323123, -0.3087613371, 0.6199701582], [-0.8803498697, 0.6468605944, -0.2368487609]),
    "syxz": ([-0.380476695, -0.0548117866, 0.5029316952, 0.7741400795], [-1.070635273, -0.1418897665, 0.6332973813]),
    "syxy": ([-0.3087613371, 0.7057323123, 0.149148728, 0.6199701582], [-2.4511461965, -0.6468605944, 1.3339475658]),
    "szxy": ([-0.1545914158, 0.6113953709, 0.3519493451, 0.691685516], [0.4483426817, 0.4832353183, -1.0049419997]),
    "szxz": ([-0.3087613371, -0.149148728, 0.7057323123, 0.6199701582], [1.7321714372, 1.076119238, -1.0146300967]),
    "szyx": ([0.5029316952, -0.380476695, -0.0548117866, 0.7741400795], [1.0799445464, -0.8442524749, 0.7746458896]),
    "szyz": ([0.149148728, -0.3087613371, 0.7057323123, 0.6199701582], [0.1613751104, -1.076119238, 0.5561662301]),
    "rzyx": ([0.6113953709, -0.1545914158, 0.3519493451, 0.691685516], [0.8865015351, -1.0525452731, -0.289503672]),
    "rxyx": ([0.7057323123, -0.3087613371, 0.149148728, 0.6199701582], [2.7255281479, 1.2523079525, -2.4768181588]),
    "ryzx": ([0.5029316952, -0.0548117866, -0.380476695, 0.7741400795], [-1.2248290542, 0.3939495163, 0.527287047]),
    "rxzx": ([0.7057323123, -0.149148728, -0.3087613371, 0.6199701582], [-1.9868608325, -1.2523079525, 2.2355708216]),
    "rxzy": ([0.3519493451, 0.6113953709, -0.1545914158, 0.691685516], [-0.1753942205, 0.6259390945, -1.1740876639]),
    "ryzy": ([0.149148728, 0.7057323123, -0.3087613371, 0.6199701582], [-0.2368487609, 0.6468605944, -0.8803498697]),
    "rzxy": ([-0.380476695, 0.5029316952, -0.0548117866, 0.7741400795], [0.6332973813, -0.1418897665, -1.070635273]),
    "ryxy": ([-0.3087613371, 0.7057323123, -0.149148728, 0.6199701582], [1.3339475658, -0.6468605944, -2.4511461965]),
    "ryxz": ([-0.1545914158, 0.3519493451, 0.6113953709, 0.691685516], [-1.0049419997, 0.4832353183, 0.4483426817]),
    "rzxz": ([-0.3087613371, 0.149148728, 0.7057323123, 0.6199701582], [-1.0146300967, 1.076119238, 1.7321714372]),
    "rxyz": ([-0.0548117866, -0.380476695, 0.5029316952, 0.7741400795], [0.7746458896, -0.8442524749, 1.0799445464]),
    "rzyz": ([-0.149148728, -0.3087613371, 0.7057323123, 0.6199701582], [0.5561662301, -1.076119238, 0.1613751104]),
}
EXPECTED = {
    "quaternion_matrix(Q)": [
        0.3131313131,
        -0.5858585859,
        -0.7474747475,
        0.0,
        0.3838383838,
        0.797979798,
        -0.4646464646,
        0.0,
        0.8686868687,
        -0.1414141414,
        0.4747474747,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "quaternion_from_matrix(euler_matrix(2.1, 0.2, 3.0))": [0.0115027686, 0.8644414864, 0.4877193822, 0.1214018418],
    "quaternion_multiply(Q, P)": [0.803, 0.245, -0.141, 0.514],
    "quaternion_inverse(Q)": [-0.101010101, 0.5050505051, -0.303030303, 0.8080808081],
    "quaternion_slerp(Q, P, 0.3)": [0.3594137445, -0.3554186041, -0.0480479215, 0.8615049468],
    "quaternion_slerp(Q, P, 0.3, 1, False)": [-0.5778513147, -0.271255434, 0.7355960618, -0.2079703072],
    "quaternion_about_axis(0.7, [1, 2, 3])": [0.0916432939, 0.1832865877, 0.2749298816, 0.9393727128],
    "random_quaternion([0.2, 0.6, 0.9])": [-0.5257311121, -0.7236067977, -0.2628655561, 0.3618033989],
    "rotation_matrix(0.7, [1, 2, 3], [4, 5, 6])": [
        0.7816391739,
        -0.4829292842,
        0.3947397982,
        0.9196509364,
        0.5501172307,
        0.8320301338,
        -0.0713924994,
        -0.9322645952,
        -0.2939578784,
        0.2729563389,
        0.9160150669,
        0.314959418,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "reflection_matrix([1, 2, 3], [3, 1, 2])": [
        -0.2857142857,
        -0.4285714286,
        -0.8571428571,
        4.7142857143,
        -0.4285714286,
        0.8571428571,
        -0.2857142857,
        1.5714285714,
        -0.8571428571,
        -0.2857142857,
        0.4285714286,
        3.1428571429,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "scale_matrix(1.5, [1, 2, 3], [3, 1, 2])": [
        1.3214285714,
        0.1071428571,
        0.2142857143,
        -1.1785714286,
        0.1071428571,
        1.0357142857,
        0.0714285714,
        -0.3928571429,
        0.2142857143,
        0.0714285714,
        1.1428571429,
        -0.7857142857,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "projection_matrix([1, 2, 3], [3, 1, 2], perspective=[5, 4, 9], pseudo=True)": [
        2.2970165182,
        -1.5505919238,
        -3.1011838477,
        17.0565111623,
        -3.4214206172,
        5.8083187506,
        -2.2809470782,
        12.5452089299,
        -7.6446249602,
        -2.5482083201,
        1.8523756496,
        28.0302915208,
        -0.8017837257,
        -0.2672612419,
        -0.5345224838,
        9.8886659508,
    ],
    "projection_matrix([1, 2, 3], [3, 1, 2], direction=[1, 0, 1])": [
        0.4,
        -0.2,
        -0.4,
        2.2,
        0.0,
        1.0,
        0.0,
        0.0,
        -0.6,
        -0.2,
        0.6,
        2.2,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "clip_matrix(-1, 2, -3, 4, 0.5, 6, True)": [
        -0.3333333333,
        0.0,
        0.3333333333,
        0.0,
        0.0,
        -0.1428571429,
        0.1428571429,
        0.0,
        0.0,
        0.0,
        -1.1818181818,
        1.0909090909,
        0.0,
        0.0,
        -1.0,
        0.0,
    ],
    "clip_matrix(-1, 2, -3, 4, 0.5, 6)": [
        0.6666666667,
        0.0,
        0.0,
        -0.3333333333,
        0.0,
        0.2857142857,
        0.0,
        -0.1428571429,
        0.0,
        0.0,
        0.3636363636,
        -1.1818181818,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "shear_matrix(0.4, [1, 0, 0], [1, 2, 3], [0, 1, 2])": [
        1.0,
        0.1890788755,
        0.378157751,
        -1.512631004,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "compose_matrix(*PARTS)": [
        0.1826735618,
        -1.6681141097,
        -0.0494628418,
        3.5714285714,
        0.658008884,
        0.139913773,
        -0.3669227926,
        4.4642857143,
        0.5751943636,
        0.6469024025,
        0.2968642147,
        5.3571428571,
        0.0059223888,
        -7.23445e-05,
        0.0157497539,
        1.0,
    ],
    "orthogonalization_matrix([10, 11, 12], [80, 70, 100])": [
        9.0940991927,
        0.0,
        0.0,
        0.0,
        -2.3663435992,
        10.8328852831,
        0.0,
        0.0,
        3.4202014333,
        1.9101299543,
        12.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "superimposition_matrix(POINTS, MOVED, True)": [
        0.9346196216,
        0.0551756761,
        0.1469352097,
        0.600079915,
        -0.0631418637,
        0.9444329347,
        0.0469860087,
        0.3020173152,
        -0.143692088,
        -0.0561268628,
        0.9350671138,
        1.0910008927,
        0.0,
        0.0,
        0.0,
        1.0,
    ],
    "vector_norm([[1, 2], [3, 4]], axis=1)": [2.2360679775, 5.0],
    "unit_vector([[1, 2], [3, 4]], axis=0)": [0.316227766, 0.4472135955, 0.9486832981, 0.894427191],
}


@pytest.fixture(scope="module")
def tft() -> ModuleType:
    spec = importlib.util.spec_from_file_location("transformations", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def near(given: Any, wanted: Any) -> bool:
    return np.allclose(np.ravel(given), wanted, atol=1e-9, rtol=0)


def test_euler_angles_in_all_conventions(tft: ModuleType) -> None:
    assert set(tft._AXES2TUPLE) == set(EULER)
    for axes, (quaternion, angles) in EULER.items():
        assert near(tft.quaternion_from_euler(0.4, -0.7, 1.3, axes), quaternion), axes
        assert near(tft.quaternion_from_euler(0.4, -0.7, 1.3, tft._AXES2TUPLE[axes]), quaternion), axes
        assert near(tft.euler_from_quaternion(Q, axes), angles), axes
        matrix = tft.euler_matrix(0.4, -0.7, 1.3, axes)
        assert near(matrix, np.ravel(tft.quaternion_matrix(quaternion))), axes
        assert near(tft.euler_matrix(*tft.euler_from_matrix(matrix, axes), axes), np.ravel(matrix)), axes
    with pytest.raises(KeyError):
        tft.euler_matrix(0, 0, 0, "sxyw")


def test_values_are_those_of_ros(tft: ModuleType) -> None:
    names = {**vars(tft), "Q": Q, "P": P, "PARTS": PARTS, "POINTS": POINTS, "MOVED": MOVED}
    for expression, wanted in EXPECTED.items():
        assert near(eval(expression, dict(names)), wanted), expression  # expressions from this file only


def test_an_array_of_one_is_an_angle(tft: ModuleType) -> None:
    quarter = tft.quaternion_from_euler(0.0, np.float64(0.0), np.deg2rad([90]))
    assert quarter == pytest.approx([0, 0, math.sqrt(0.5), math.sqrt(0.5)])
    assert tft.euler_matrix(0, 0, np.array([math.pi]))[0, 0] == pytest.approx(-1)


def test_what_a_matrix_was_made_of_is_found_again(tft: ModuleType) -> None:
    rng = random.Random(4)

    def vector() -> list[float]:
        return [rng.uniform(-1, 1) for _ in range(3)]

    for _ in range(20):
        angle, direction, point, normal = rng.uniform(-3, 3), vector(), vector(), vector()
        across = np.cross(direction, normal)
        for made, parts, again in (
            (tft.rotation_matrix(angle, direction, point), tft.rotation_from_matrix, tft.rotation_matrix),
            (tft.reflection_matrix(point, normal), tft.reflection_from_matrix, tft.reflection_matrix),
            (tft.scale_matrix(angle, point), tft.scale_from_matrix, tft.scale_matrix),
            (tft.scale_matrix(angle, point, direction), tft.scale_from_matrix, tft.scale_matrix),
            (tft.projection_matrix(point, normal), tft.projection_from_matrix, tft.projection_matrix),
            (tft.projection_matrix(point, normal, direction), tft.projection_from_matrix, tft.projection_matrix),
            (
                tft.projection_matrix(point, normal, perspective=direction),
                tft.projection_from_matrix,
                tft.projection_matrix,
            ),
            (tft.shear_matrix(0.4, direction, point, across), tft.shear_from_matrix, tft.shear_matrix),
            (tft.compose_matrix(*PARTS), tft.decompose_matrix, tft.compose_matrix),
        ):
            assert tft.is_same_transform(again(*parts(made)), made), parts
        eye = tft.projection_matrix(point, normal, perspective=direction, pseudo=True)
        assert tft.is_same_transform(tft.projection_matrix(*tft.projection_from_matrix(eye, True)), eye)
    for given, parts in zip(tft.decompose_matrix(tft.compose_matrix(*PARTS[:4]))[:4], PARTS[:4], strict=True):
        assert near(given, parts)
    moved = tft.concatenate_matrices(tft.translation_matrix([1, 2, 3]), tft.euler_matrix(0, 0, 0.5))
    assert tft.rotation_from_matrix(moved)[0] == pytest.approx(0.5)
    assert near(tft.translation_from_matrix(moved), [1, 2, 3])
    for bad, call in (
        ("singular", lambda: tft.decompose_matrix(np.zeros((4, 4)) + np.diag([0, 0, 0, 1.0]))),
        ("no rotation", lambda: tft.rotation_from_matrix(np.diag([1, 2, 3, 1.0]))),
        ("not orthogonal", lambda: tft.shear_matrix(0.1, [1, 0, 0], [0, 0, 0], [1, 0, 0])),
    ):
        with pytest.raises(ValueError, match=bad):
            call()


def test_an_unfilled_quaternion_is_no_rotation(tft: ModuleType) -> None:
    assert repr(tft.euler_from_quaternion([0, 0, 0, 0])) == "(0.0, -0.0, 0.0)"
    assert tft.euler_from_quaternion((0, 0, 1, 1))[2] == pytest.approx(math.pi / 2)
    assert near(tft.quaternion_matrix([0, 0, 0, 0]), np.ravel(np.identity(4)))


def test_a_trackball_turns_by_twice_the_arc(tft: ModuleType) -> None:
    ball = tft.Arcball([0, 0, 0, 1])
    ball.place([320, 320], 320)
    ball.down([320, 320])
    ball.drag([320 + 320 * math.sin(0.2), 320])
    assert near(tft.euler_from_matrix(ball.matrix()), [0, 0.4, 0])
    ball.next()
    assert near(tft.euler_from_matrix(ball.matrix()), [0, 0.8, 0])
    ball.setaxes([1, 0, 0], [0, 1, 0])
    ball.setconstrain(True)
    ball.down([420, 320])
    ball.drag([400, 330])
    assert (ball.getconstrain(), tft.euler_from_matrix(ball.matrix())[0]) == (True, pytest.approx(0))


def test_yaw_from_odometry_needs_no_numpy() -> None:
    program = "import sys, transformations as t; t.euler_from_quaternion((0, 0, 0, 1)); print('numpy' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        env={"PYTHONPATH": str(FILE.parent)},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert done.stdout == "False\n"
