"""`goshawk demo`: the whole chain on a rendered room, with a table of errors against ground truth."""

import shutil
import sys
from pathlib import Path
from typing import Any

import click

from goshawk.terminal import console, outputs

SUMMARY = "Run the whole chain on a rendered room."


@click.command()
@console.path_option("--out", "out", "Project folder to write.", required=True)
@click.option(
    "--pairs",
    type=click.IntRange(2),
    default=60,
    show_default=True,
    help="Image pairs to render; fewer take less time and give a less accurate map.",
)
@console.common_options
def command(out: Path, pairs: int, as_json: bool) -> None:
    """Map a rendered room, plan through it, fly the SITL vehicle, learn its model. About two minutes.

    \b
    goshawk demo --out demo-out
    goshawk demo --out demo-out --json > demo.json

    Images are rendered and the vehicle is simulated; COLMAP, planner, gate, C controller, link and estimator are those
    of a real flight. The results are written to demo.json in the project.

    Each run makes the folder anew. An earlier demo in which you changed anything is kept beside it as OUT.old-1.
    """
    from goshawk.demo import chain

    console.note("rendered room -> map -> checked trajectories -> SITL flights -> learned vehicle")
    with console.progress() as report:
        facts = chain.run(out, pairs=pairs, progress=report)
    if as_json:
        console.show("", {}, as_json=True, document=facts)
        return
    _show(facts)
    click.echo("try next:")
    module = f"{sys.executable} -m goshawk" if Path(sys.argv[0]).name == "__main__.py" else sys.argv[0]
    me = "goshawk" if shutil.which("goshawk") else module
    vehicles = f"--vehicle {out}/vehicle.toml --vehicle {out}/learned.toml"
    click.echo(f"  {me} gcs {out}")
    click.echo(f"  {me} check {out}/trajectories/walk.json --map {out}/map --vehicle {out}/vehicle.toml")
    click.echo(f"  {me} compare {out}/flights/walk.parquet {vehicles}")
    click.echo("figures:")
    for figure in sorted(p for p in (out / "figures").rglob("*") if p.suffix in outputs.PICTURES):
        click.echo(f"  {figure}")


def _show(facts: dict[str, Any]) -> None:
    area, accuracy = facts["map"], facts["map"]["accuracy"]
    surface = accuracy["surface"]
    console.show(
        "map",
        {
            "images registered": f"{area['images_placed']} of {area['images']}",
            "pose error": f"{1000 * accuracy['position_rms_m']:.1f} mm rms",
            "scale": f"{accuracy['scale']:.4f} of the true scale ({area['scale_source']})",
            "surface error": f"{1000 * surface['median_error_m']:.1f} mm median, "
            f"{100 * surface['share_within_5cm']:.1f} % of it within 5 cm",
            "surface found": f"{100 * surface['seen_share_within_5cm']:.1f} % of what the cameras saw",
            "marked free but solid": f"{100 * surface['free_share_in_matter']:.3f} % of the free voxels",
        },
        as_json=False,
    )
    plans, flights = facts["plans"], facts["flights"]
    rows = [
        (
            name,
            f"{plans[name]['duration_s']:.2f} s" if name in plans else "",
            f"{plans[name]['clearance_m']:.2f} m" if name in plans else "",
            f"{flown['top_speed_m_s']:.1f} m/s",
            f"{1000 * flown['tracking_mean_m']:.0f} mm",
            f"{1000 * flown['tracking_worst_m']:.0f} mm",
        )
        for name, flown in flights.items()
    ]
    console.table("flights", ("flight", "planned", "clearance", "top speed", "tracking mean", "worst"), rows)
    rows = [
        (
            name,
            f"{p['truth']:.4g}",
            "" if p["without_effect"] is None else f"{p['without_effect']:.4g}",
            f"{p['estimate']:.4g} ± {p['std']:.1g}",
            p["unit"],
        )
        for name, p in facts["identified"].items()
    ]
    console.table(
        "identified from the training flights", ("parameter", "truth", "without rotor drag", "with", "unit"), rows
    )
    held = facts["held_out"]
    heads = ("position error after", *(f"{h:g} s" for h in held["horizons_s"]))
    rows = [
        (model, *(f"{1000 * error:.1f} mm" for error in found["error_rms"]["position_m"]))
        for model, found in held["models"].items()
    ]
    console.table("prediction of the held-out walk", heads, rows)
