"""Rays hit the same when geoms that they can't reach are left out of the model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_rays import RayModel
from services.sim.physics.mujoco_scene import SEEN_GROUPS

FAR = 2.0
"""Range of the rays [m]."""


def cast(model: mujoco.MjModel, data: mujoco.MjData, origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cast a full turn of rays in the plane; return the distances [m], inf beyond ``FAR``."""
    angles = np.linspace(-np.pi, np.pi, 721)
    rays = np.stack((np.cos(angles), np.sin(angles), np.zeros(len(angles))), axis=1).ravel()
    hit, distance = np.empty(len(angles), np.int32), np.empty(len(angles))
    mujoco.mj_multiRay(model, data, origin, rays, SEEN_GROUPS, 1, -1, hit, distance, None, len(angles), FAR)
    return np.where((distance < 0) | (distance > FAR), np.inf, distance)


def test_what_is_unseen_or_out_of_reach_is_left_out_and_nothing_else() -> None:
    rng = np.random.default_rng(3)
    bodies = "".join(
        f"<body pos='{x:.3f} {y:.3f} 0.1'><freejoint/><geom type='box' size='.1 .2 .1'/>"
        "<geom type='sphere' size='.05' pos='0 .2 0'/>"
        "<body><geom type='sphere' size='.5' group='2'/><joint/></body></body>"
        for x, y in rng.uniform(-6, 6, (40, 2))
    )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><geom type='plane' size='0 0 1' group='4'/>{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    seen, origins = RayModel(model), np.column_stack((rng.uniform(-6, 6, (20, 2)), np.full(20, 0.1)))
    near = seen.near(data, origins, FAR)
    assert near.shape == (20, 41)
    assert near[:, 0].all(), "a plane is everywhere"
    assert near.sum() < near.size / 2
    met = 0
    for origin, bodies_near in zip(origins, near, strict=True):
        everything = cast(model, data, origin)
        assert cast(seen.model, data, origin).tobytes() == everything.tobytes()
        seen.keep(bodies_near)
        assert cast(seen.model, data, origin).tobytes() == everything.tobytes()
        seen.keep(np.zeros_like(bodies_near))
        assert np.isinf(cast(seen.model, data, origin)).all()
        seen.keep_all()
        met += int(np.isfinite(everything).sum())
    assert met > 1000
