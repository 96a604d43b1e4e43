"""The state service as joint_state_publisher alone, beside another node that publishes the transforms."""

from __future__ import annotations

import pytest

from messages.std import String
from messages.topics import JOINT_STATES, ROBOT_DESCRIPTION, TF, TF_STATIC
from services.runtime.errors import BadInput
from services.runtime.testing import run_service
from services.state import SERVICE, StateParameters
from tests.services.state import sample_urdfs


def test_joint_states_without_transforms() -> None:
    params = StateParameters(publish_transforms=False, publish_default_positions=True)
    with run_service(SERVICE, "/", params) as service:
        service.publish(ROBOT_DESCRIPTION, String(data=sample_urdfs.GRIPPER))
        for tick in range(26):
            service.set_time(tick / 50)
        states = service.drain(JOINT_STATES)
        assert len(states) == 6, "10 Hz"
        assert states[0].name
        assert service.drain(TF) == service.drain(TF_STATIC) == []


def test_nothing_to_publish_is_an_error() -> None:
    with (
        pytest.raises(BadInput, match="nothing to publish"),
        run_service(SERVICE, "/", StateParameters(publish_transforms=False)),
    ):
        pass
