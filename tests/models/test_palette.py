"""The robots' palette: a colour for each, distinguishable with any colour vision, and the same in all processes."""

from __future__ import annotations

import itertools

import numpy as np

from models.palette import COLOURS, Colour, Palette, colour, colours, hexadecimal

CONES = {
    "all": np.eye(3),
    "no long": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no middle": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no short": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""Linear sRGB as seen without one kind of cones (Machado, Oliveira and Fernandes, 2009, severity 1)."""


def linear(each: Colour) -> np.ndarray:
    share = np.array(each) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def oklab(light: np.ndarray) -> np.ndarray:
    """Convert linear sRGB to OKLab (Ottosson, 2020)."""
    to_cones = [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
    to_lab = [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
    seen: np.ndarray = np.array(to_lab) @ np.cbrt(np.array(to_cones) @ np.clip(light, 0, 1))
    return seen


def test_eight_are_told_apart_by_every_eye_and_on_every_ground() -> None:
    assert len(COLOURS) >= 8
    for eye, sees in CONES.items():
        for one, other in itertools.combinations(COLOURS, 2):
            apart = np.linalg.norm(oklab(sees @ linear(one)) - oklab(sees @ linear(other)))
            assert apart > (0.13 if eye == "all" else 0.08), (eye, hexadecimal(one), hexadecimal(other), apart)
    for each in COLOURS:
        assert 0.1 < float(np.array([0.2126, 0.7152, 0.0722]) @ linear(each)) < 0.45, hexadecimal(each)


def test_none_repeats() -> None:
    many = [colour(index) for index in range(100)]
    assert len(set(many)) == 100
    assert all(0 <= part <= 255 for each in many for part in each)


def test_a_name_has_the_same_colour_whatever_order_they_come_in() -> None:
    names = ["arm", "p3dx", *(f"tb3_{number}" for number in range(12))]
    assert colours(names) == colours(reversed(names))
    assert [colours(names)[name] for name in names] == [colour(index) for index in range(14)], "tb3_2 before tb3_10"


def test_a_robot_that_comes_later_changes_nobody_elses() -> None:
    palette = Palette(["b", "c"])
    before = palette.colour("b"), palette.colour("c")
    assert palette.colour("a") == colour(2)
    assert (palette.colour("b"), palette.colour("c")) == before == (colour(0), colour(1))
    assert hexadecimal((0, 171, 255)) == "#00abff"


def test_the_next_colours_are_those_that_names_to_come_would_take() -> None:
    palette = Palette(["a", "b"])
    free = palette.next_colours(8)
    assert len({*free, palette.colour("a"), palette.colour("b")}) == 10
    assert [palette.colour(name) for name in ("d", "c")] == free[:2]
    assert palette.next_colours(2) == free[2:4]
