"""``elea report``: the report of a run that has ended."""

from __future__ import annotations

from pathlib import Path

import click

from deploy.commands.options import json_option
from services.runtime.errors import BadInput


@click.command("report")
@click.argument("run", required=False, type=click.Path(path_type=Path))
@click.option("--all", "every", is_flag=True, help="Show every robot and every check, the worst robots first.")
@json_option
def command(run: Path | None, every: bool, as_json: bool) -> None:
    """Show the report of RUN, the folder of a run; the latest run by default.

    With more than 8 robots, the table shows the worst and summarizes the others. The exit status is that of ./elea up:
    0 if every check holds, 1 if not, 2 for bad input.
    """
    from deploy.live.output import write_text
    from deploy.report.record import REPORT_FILE, read_report
    from deploy.report.table import print_report
    from deploy.report.write import to_json
    from deploy.run_folder import latest_run_folder

    folder = latest_run_folder() if run is None else run
    if folder is None:
        raise BadInput("there is no run yet: start one with ./elea up, or name the folder of a run")
    report = read_report(folder)
    if report is None:
        raise BadInput(f"{folder} holds no {REPORT_FILE} that can be read: is it the folder of a run that has ended?")
    if as_json:
        write_text(to_json(report).decode())
    else:
        print_report(report, every=every)
    raise SystemExit(0 if report.ok else 1)
