"""The reference service's loop on the in-memory transport; the test plays the simulation."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from messages.topics import REFERENCE
from services.reference import SERVICE, ReferenceParameters
from services.reference.loop import open_table
from services.runtime.errors import BadInput
from services.runtime.testing import ServiceHarness, run_service


def play(bench: ServiceHarness, seconds: float, epoch: int = 0) -> list[float]:
    values = []
    for step in range(round(seconds * 50)):
        bench.set_time(step / 50, epoch)
        values.append(bench.next(REFERENCE).data)
    return values


def test_a_sine_in_simulation_time_begins_anew_with_it() -> None:
    with run_service(SERVICE, "/arm", ReferenceParameters(reference_type="sine", sin_ref_f=1.0)) as bench:
        first = play(bench, 0.7)
        assert first == pytest.approx([30.0 * math.sin(math.tau * step / 50) for step in range(35)])
        assert play(bench, 0.7, epoch=1) == first


def test_what_the_joint_cannot_do_is_clipped_and_said() -> None:
    p = ReferenceParameters(ref_angle=120.0, lower=-45.0, upper=60.0)
    with run_service(SERVICE, "/arm", p) as bench:
        assert play(bench, 0.1) == [60.0] * 5
        assert "step is at 120.0 deg, clipped to the joint's range from -45 to 60 deg" in bench.log


def test_what_cannot_be_followed_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="needs a file"):
        open_table(ReferenceParameters(reference_type="csv"))
    with pytest.raises(BadInput, match=r"lower = 5 deg is not below upper = 5 deg"):
        open_table(ReferenceParameters(lower=5.0, upper=5.0))
    file = tmp_path / "way.csv"
    file.write_text("0,0\n1,25\n")
    assert open_table(ReferenceParameters(csv=str(file))) is not None
    assert open_table(ReferenceParameters()) is None
