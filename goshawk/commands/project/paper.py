"""`goshawk paper`: what Rigter et al. (2019) showed, done again; theirs beside ours."""

from pathlib import Path
from typing import Any

import click

from goshawk.terminal import console, outputs

SUMMARY = "Do again what the paper showed, theirs beside ours."
NAMES = ("vehicle", "ladder", "path")
"""Of `goshawk.paper.parts.PARTS`, whose import takes long."""


@click.command()
@console.path_option("--out", "out", "Folder to write paper.html, paper.json and the pictures to.", required=True)
@click.option("--only", type=click.Choice(NAMES), multiple=True, help="Part to do [default: all]; repeat for more.")
@outputs.overwrite_option
@console.common_options
def command(out: Path, only: tuple[str, ...], overwrite: bool, as_json: bool) -> int:
    """Identify the vehicle of Rigter et al. (2019), fly their ladder and a planned path; theirs beside ours.

    \b
    goshawk paper --out paper
    goshawk paper --out paper --only ladder

    Their numbers were flown; ours are simulated, on rendered images. Numbers of theirs are those that our sources
    state. About four minutes; Ctrl-C keeps the parts that are done, and --only PART --overwrite does one that is
    missing, with the others taken over.
    """
    from flight import results
    from goshawk.paper import parts

    results.require_free_folder(out, overwrite=overwrite, ours=parts.is_ours)
    asked = [name for name in NAMES if not only or name in only]
    with results.new_folder(out, overwrite=overwrite, ours=parts.is_ours) as placing:
        with console.progress() as report:
            done, failed = parts.run(placing.temporary, asked, report)
        missing = [name for name in asked if name not in done and name not in failed]
        taken = parts.take_over(out, placing.temporary, [name for name in NAMES if name not in asked])
        document = parts.write(placing.temporary, taken | done, missing=missing, failed=failed, taken_over=list(taken))
    outputs.report_kept(out, placing.kept)
    if as_json:
        console.show("", {}, as_json=True, document=document)
    else:
        _show(document)
        click.echo(f"page: {out / parts.PAGE}")
    for name, reason in failed.items():
        click.echo(f"goshawk: {name} failed: {reason}", err=True)
    if missing:
        click.echo(f"goshawk: stopped before {', '.join(missing)}", err=True)
        return 130
    return 1 if failed else 0


def _show(document: dict[str, Any]) -> None:
    if "vehicle" in document:
        rows = [
            (row["name"], row["theirs"], row["ours"], row["standard_error_of_one_trial"], row["unit"])
            for row in document["vehicle"]
        ]
        console.table(
            "Table I: theirs, and ours simulated", ("parameter", "theirs", "ours", "± of one trial", "unit"), rows
        )
    if "ladder" in document:
        rows = [
            (row["course"], row["controller"], "" if row["theirs_cm"] is None else f"{row['theirs_cm']:g}",
             f"{row['ours_cm']:.2f}")
            for row in document["ladder"]
        ]  # fmt: skip
        heads = ("mean tracking error, cm", "controller", "theirs, flown", "ours, simulated")
        console.table("ladder", heads, rows)
    if "path" in document:
        console.show("path, rendered and simulated", document["path"], as_json=False)
