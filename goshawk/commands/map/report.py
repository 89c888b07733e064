"""`goshawk map report`: a map as one offline HTML page."""

from pathlib import Path

import click

import mapping
from goshawk.terminal import console, outputs


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "HTML page to write.", required=True)
@outputs.overwrite_option
@console.common_options
def report(map_folder: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Write all that is known of MAP as one HTML file that needs no network.

    \b
    goshawk map report map --out map.html

    The verdict with its reasons, every source of the scale, the camera file on trial and reprojection errors. Then
    coverage, from above and from the side, and where to look again.
    """
    from goshawk.commands.map import report_page  # with its pages, a third of what `goshawk map` would import

    outputs.check(out, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    with outputs.file(out, overwrite=overwrite) as temporary:
        report_page.write(temporary, area)
    console.show("report", {"verdict": str(area.standing), "written": str(out)}, as_json=as_json)
