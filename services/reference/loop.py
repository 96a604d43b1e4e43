"""The loop of the reference service: publishes the waveform that the parameters select."""

from __future__ import annotations

from pathlib import Path

from messages.std import Float32
from messages.topics import REFERENCE
from services.reference import ReferenceParameters
from services.reference.waveforms import ReferenceTable, WaveformGenerator, read_table
from services.runtime.context import Context
from services.runtime.errors import BadInput


def run(ctx: Context[ReferenceParameters]) -> None:
    """Publish until asked to stop. A reset of simulation time restarts the waveform."""
    table = open_table(ctx.params)
    out = ctx.advertise(REFERENCE)
    generator, logged = WaveformGenerator(table), ""
    for tick in ctx.ticks():
        p = ctx.params
        if tick.reset:
            generator = WaveformGenerator(table)
        angle = generator.step(p, tick.dt)
        if p.reference_type != logged:
            logged = p.reference_type
            ctx.log.info(f"{logged} starts at {angle:.2f} deg")
        if p.reference_type == "csv" and table is None:
            ctx.log.warn("reference_type is csv but no file was given, holding the angle: start with csv=FILE", every=5)
        bounded = max(p.lower, min(p.upper, angle))
        if bounded != angle:
            ctx.log.warn(
                f"{p.reference_type} is at {angle:.1f} deg, clipped to the joint's range from {p.lower:g} to "
                f"{p.upper:g} deg",
                every=5,
            )
        out.publish(Float32(data=bounded))


def open_table(p: ReferenceParameters) -> ReferenceTable | None:
    """Return the table in the CSV file, if there is one; raises BadInput for bad parameters or a bad file."""
    if not p.lower < p.upper:
        raise BadInput(f"lower = {p.lower:g} deg is not below upper = {p.upper:g} deg")
    if p.csv:
        return read_table(Path(p.csv).absolute())
    if p.reference_type == "csv":
        raise BadInput("reference_type = csv needs a file: csv = PATH")
    return None
