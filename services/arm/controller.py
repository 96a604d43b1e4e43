"""The controller: one of the laws, and the change from one to the other."""

from __future__ import annotations

from services.arm import ArmParameters
from services.arm.gains import gains_of
from services.arm.pid import Pid, Sight
from services.arm.seed import SeedPid


class Controller:
    """What is wanted and what is go in, the effort comes out. One that is new has no past."""

    def __init__(self) -> None:
        self._law = ""
        self._pid, self._seed = Pid(), SeedPid()
        self._effort: float | None = None

    @property
    def integral(self) -> float:
        """What the summed error stands at: N m in the default law, deg s in the seed's."""
        return self._seed.summed if self._law == "seed" else self._pid.integral

    def step(self, p: ArmParameters, now: Sight, dt: float) -> float:
        """The effort [N m], ``dt`` [s] after the step before; 0 when that is not known."""
        gains = gains_of(p)
        changed = p.law != self._law
        self._law = p.law
        if p.law == "seed":
            self._seed = SeedPid() if changed else self._seed
            self._effort = self._seed.step(gains, p.windup_guard, now.error, now.angle, dt)
        else:
            last = self._effort if changed else None
            self._pid = Pid() if changed else self._pid
            self._effort = self._pid.step(gains, now, dt, last)
        return self._effort
