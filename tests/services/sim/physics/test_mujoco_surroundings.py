"""MuJoCo's environment: OpenGL libraries for rendering, and the destination of its warnings."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.runtime.errors import BadInput
from services.sim.physics import mujoco_camera
from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_camera import open_context


def test_without_an_opengl_library_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = {name: (f"libNone-{name}.so.1",) for name in mujoco_camera.LIBRARIES}
    monkeypatch.setattr(mujoco_camera, "LIBRARIES", missing)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(
        BadInput, match=r"apt install libegl1 .*egl: libNone-egl.so.1 is not installed; osmesa: libNone"
    ):
        open_context(8, 8)
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    with pytest.raises(BadInput, match=r"\(osmesa: libNone-osmesa.so.1 is not installed\)"):
        open_context(8, 8)


def test_after_a_library_that_does_not_work_the_next_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """PyOpenGL would stay bound to the first."""
    tried = []

    def fail(name: str) -> object:
        tried.append(name)
        assert "PYOPENGL_PLATFORM" not in mujoco_camera.os.environ
        mujoco_camera.os.environ["PYOPENGL_PLATFORM"] = name
        raise ImportError("it has no display")

    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    monkeypatch.setattr(mujoco_camera, "LIBRARIES", {"egl": ("libc.so.6",), "osmesa": ("libc.so.6",)})
    monkeypatch.setattr(mujoco_camera.importlib, "import_module", fail)
    monkeypatch.setattr(mujoco_camera.sys, "modules", dict(mujoco_camera.sys.modules))
    with pytest.raises(BadInput, match="egl: it has no display; osmesa: it has no display"):
        open_context(8, 8)
    assert tried == ["mujoco.egl", "mujoco.osmesa"]


def test_a_warning_goes_to_the_log_and_into_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    ball = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(ball)
    data = mujoco.MjData(model)
    data.qvel[0] = 1e20
    mujoco.mj_step(model, data)
    mujoco.mj_saveModel(model, "/proc/none")
    assert "MuJoCo warns: Nan, Inf or huge value in QVEL" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
