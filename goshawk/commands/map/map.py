"""`goshawk map`: maps, from images, of one another and of other programs."""

import click

from goshawk.commands.map.again import again
from goshawk.commands.map.build import build, check
from goshawk.commands.map.copies import align, crop, merge, origin
from goshawk.commands.map.edit import edit
from goshawk.commands.map.export_map import export
from goshawk.commands.map.import_map import import_
from goshawk.commands.map.measure import measure
from goshawk.commands.map.report import report
from goshawk.commands.map.show_esdf import show_esdf
from goshawk.commands.map.texture import texture
from goshawk.terminal.verbs import VerbGroup

SUMMARY = "Turn images into a map: poses, mesh, distance field; measure, edit and join maps."


@click.group(cls=VerbGroup)
def command() -> None:
    """Turn images into a map, show it, edit it, and make new maps of it.

    \b
    goshawk map build images --camera images/camera.toml --out map
    goshawk map report map --out map.html
    """


for verb in (
    build,
    check,
    report,
    show_esdf,
    measure,
    again,
    edit,
    crop,
    origin,
    align,
    merge,
    texture,
    import_,
    export,
):
    command.add_command(verb)
