"""``elea sweep``: a fleet with every combination of seeds and values."""

from __future__ import annotations

import asyncio
import hashlib
import sys
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from deploy import INTERRUPTED
from deploy.commands.completion import FLEET
from deploy.fleet import MODES
from services.runtime.errors import BadInput
from services.sim.engines import ENGINES

if TYPE_CHECKING:
    from deploy.sweep.definition import Definition, Run
    from deploy.sweep.results import Result, Row

_SET_HELP = (
    "Vary a key of the fleet file or a parameter: KEY=VALUE,VALUE as for up --set, or 'SET NAME=VALUE,VALUE', e.g. "
    "'/tb3_0/waypoint max_linear=0.1,0.15,0.2'. May be repeated; all combinations are run."
)


@click.command("sweep")
@click.argument("fleet", default="", type=FLEET)
@click.option("--seeds", default="", metavar="SEEDS", help="Random seeds: 0..31, or 1,2,7..9; the fleet's by default.")
@click.option("--set", "assignments", multiple=True, metavar="KEY=VALUES", help=_SET_HELP)
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Runs at a time.")
@click.option(
    "--report", metavar="DIR", default="", help="Folder of the sweep; TIME-FLEET-sweep below --runs by default."
)
@click.option("--runs", metavar="DIR", default="", help="Parent folder of the run folders; runs by default.")
@click.option("--resume", metavar="DIR", default="", help="Resume the sweep in DIR, as defined there.")
@click.option("--retry", is_flag=True, help="Run again the runs that ended without a report.")
@click.option("--plot", metavar="FIGURE", default="", help="Report figure to plot, e.g. tb3_0.track_max_m.")
@click.option(
    "--over", metavar="KEY", default="", help="Varied key on the x axis of the plot; the first numeric one by default."
)
@click.option("--mode", type=click.Choice(MODES), help="How time runs; the fleet's by default.")
@click.option("--engine", type=click.Choice(ENGINES), help="Physics engine; the fleet's by default.")
@click.option("--factor", type=float, help="Simulated seconds per wall-clock second, in mode real.")
@click.option("--duration", type=float, metavar="S", help="End each run after S seconds of simulation time.")
@click.option("--json", "as_json", is_flag=True, help="Print the table as JSON.")
def command(
    fleet: str,
    seeds: str,
    assignments: tuple[str, ...],
    jobs: int,
    report: str,
    runs: str,
    resume: str,
    retry: bool,
    plot: str,
    over: str,
    as_json: bool,
    **options: Any,
) -> None:
    """Run FLEET (lab by default) once for each combination, and tabulate the reports in sweep.csv and sweep.parquet.

    Ctrl-C ends the current runs; the same command with --report DIR, or --resume DIR, runs the missing ones, also
    after a crash. Saved parameters are neither used nor changed. The exit status is 0 if all checks of
    all runs pass, 1 if not, 2 for bad input, 130 if interrupted.
    """
    from deploy.sweep.runner import open_folder, read_definition

    if resume:
        if fleet or seeds or assignments or report or runs or any(each is not None for each in options.values()):
            raise BadInput("--resume takes the sweep from its folder: give no fleet, seeds, values or options with it")
        folder = Path(resume).absolute()
        definition = read_definition(folder)
    else:
        definition = _define(fleet or "lab", seeds, assignments, options)
        folder = _folder(definition, report, runs)
    robots = check_definition(definition)
    _check_picture(definition, robots, plot, over)
    with open_folder(folder, definition):
        status = _run(definition, folder, jobs, retry, plot, over, as_json)
    raise SystemExit(status)


def _define(fleet: str, seeds: str, assignments: tuple[str, ...], options: dict[str, Any]) -> Definition:
    from deploy.fleet_file import find_fleet
    from deploy.sweep.definition import Definition, read_axes

    stated = [(f"--{name}", str(value)) for name, value in options.items() if value is not None]
    return Definition(
        fleet=str(Path(fleet).absolute()) if Path(fleet).suffix == ".toml" else fleet,
        digest=_digest(find_fleet(fleet)),
        axes=read_axes(seeds, assignments),
        options=tuple(word for pair in stated for word in pair),
    )


def _digest(file: Path) -> str:
    """Return a digest of a fleet file and the user services that it names; raises BadInput for an invalid fleet."""
    from deploy.fleet_file import read_fleet
    from deploy.fleet_validation import all_services
    from services.catalog import is_user_file

    kinds = dict.fromkeys(member.kind for _, member, _ in all_services(read_fleet(file)))
    digest = hashlib.sha256()
    for each in (file, *(Path(kind) for kind in kinds if is_user_file(kind))):
        try:
            digest.update(hashlib.sha256(each.read_bytes()).digest())
        except OSError as error:
            raise BadInput(f"{each} cannot be read: {error.strerror}") from None
    return digest.hexdigest()


def _folder(definition: Definition, report: str, runs: str) -> Path:
    from services.runtime.user_folders import runs_folder

    if report:
        return Path(report).absolute()
    name = f"{datetime.now():%Y%m%d-%H%M%S}-{Path(definition.fleet).stem}-sweep"
    return (Path(runs).absolute() if runs else runs_folder()) / name


def check_definition(definition: Definition) -> tuple[str, ...]:
    """Check every run's fleet as far as possible without starting it; return its robots. Raises BadInput."""
    from deploy.commands.up import override_run
    from deploy.fleet_file import find_fleet, read_fleet
    from deploy.sweep.definition import SEED

    file = find_fleet(definition.fleet)
    if _digest(file) != definition.digest:
        raise BadInput(f"{file}, or a file that it names, has changed since this sweep began: begin another one")
    options: dict[str, Any] = {"mode": None, "engine": None, "factor": None, "duration": None, "port": None}
    for name, value in zip(definition.options[::2], definition.options[1::2], strict=True):
        options[name.removeprefix("--")] = float(value) if name in ("--factor", "--duration") else value
    robots: dict[str, None] = {}
    checked: set[tuple[str, ...]] = set()
    for run in definition.runs:
        overrides = definition.overrides(run)
        if overrides in checked:
            continue
        checked.add(overrides)
        seed = int(run.values[SEED]) if SEED in run.values else None
        fleet = override_run(read_fleet(file, overrides), {**options, "seed": seed})
        if fleet.run.ends == "never":
            raise BadInput(f"the fleet {fleet.name} never ends by itself: say when each run ends, with --duration S")
        robots |= dict.fromkeys(each.name for each in fleet.robot)
    return tuple(robots)


def _check_picture(definition: Definition, robots: tuple[str, ...], plot: str, over: str) -> None:
    from deploy.sweep.results import check_figure

    if over and not plot:
        raise BadInput("--over KEY is the x axis of --plot FIGURE: give both")
    if plot:
        from deploy.sweep.picture import choose_axis

        check_figure(plot, robots, "--plot")
        choose_axis(definition, over)


def _run(definition: Definition, folder: Path, jobs: int, retry: bool, plot: str, over: str, as_json: bool) -> int:
    from deploy.live.output import ignore_output_errors, write_json
    from deploy.progress import open_display
    from deploy.sweep.results import make_row, read_result, write_tables
    from deploy.sweep.runner import Sweep, pending_runs, run_folder
    from services.runtime.atomic_file import write_atomic

    pending, total = pending_runs(folder, definition, retry), len(definition.runs)
    interrupted = False
    if pending:
        done, began = total - len(pending), time.monotonic()
        with open_display() as shown:
            shown.print_line(f"{len(pending)} of {total} runs, {jobs} at a time; results in {folder}")
            ended = 0

            def finished(run: Run, result: Result) -> None:
                nonlocal ended
                ended += 1
                left = (len(pending) - ended) * (time.monotonic() - began) / ended
                outcome = describe_result(result)
                values = ", ".join(f"{each.name} {run.values[each.name]}" for each in definition.varied)
                shown.print_line(
                    f"[{done + ended}/{total}] {values or definition.fleet}: {outcome} ({result.seconds:.0f} s)"
                    + (f"; about {_duration(left)} left" if ended < len(pending) else "")
                )

            sweep = Sweep(folder, definition, jobs, finished)
            asyncio.run(sweep.run(pending))
            interrupted = sweep.interrupted
    rows = []
    for run in definition.runs:
        if (result := read_result(run_folder(folder, run))) is not None:
            rows.append(make_row(run, run_folder(folder, run), result))
    write_tables(definition, rows, folder)
    with ignore_output_errors():
        if as_json:
            write_json(rows)
        else:
            _print_table(definition, rows, plot)
        sys.stdout.flush()
    if plot and rows:
        from deploy.sweep.picture import draw

        file = folder / f"{plot.strip('/').replace('/', '_')}.png"
        write_atomic(file, draw(definition, rows, plot, over))
        sys.stderr.write(f"picture: {file}\n")
    if interrupted:
        sys.stderr.write(
            f"interrupted: {len(rows)} of {total} runs are done; go on with ./elea sweep --resume {folder}\n"
        )
        return INTERRUPTED
    return 0 if all(row["status"] == 0 for row in rows) else 1


def describe_result(result: Result) -> str:
    """Describe the end of a run in a few words."""
    if result.error:
        return f"failed: {result.error}"
    return "passed" if result.status == 0 else "missed a bound" if result.status == 1 else f"status {result.status}"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _print_table(definition: Definition, rows: list[Row], plot: str) -> None:
    from deploy.live.output import format_table, write_text

    names = ["run", *(each.name for each in definition.varied), "result", "sim_seconds", *([plot] if plot else [])]
    lines = [names, *([_cell(row, name) for name in names] for row in rows)]
    write_text(f"{format_table(lines)}\n")


def _cell(row: Row, name: str) -> str:
    if name == "result":
        if row["error"]:
            return f"failed: {row['error']}"
        return "passed" if row["status"] == 0 else f"{row['missed']} missed" if row["missed"] else "failed"
    value = row.get(name)
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
