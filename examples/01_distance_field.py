"""Distance to the nearest surface: build a distance field from solids, query, edit and draw it.

You will see: agreement with the closed form, and an edit in `distance_field.png`. The idea: the field is exact, and
unknown space is never free.
"""

import sys
from pathlib import Path

import numpy as np

import esdf
from esdf import Edit, Editor, pictures, solids
from goshawk import plot

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")

room = solids.Scene(
    [
        solids.Room((0.0, 0.0, 0.0), (6.0, 4.0, 2.5)),
        solids.Cylinder((2.0, 1.5, 1.25), 0.25, 2.5),
        solids.Cylinder((4.0, 2.6, 1.25), 0.35, 2.5),
    ]
)
grid = esdf.Grid(np.array([-0.2, -0.2, -0.2]), np.full(3, 0.05), (128, 88, 58))
field = esdf.build(esdf.rasterize(room, grid), grid, cap_m=2.0)

rng = np.random.default_rng(1)
points = rng.uniform([0.3, 0.3, 0.3], [5.7, 3.7, 2.2], size=(20_000, 3))
points = points[room.distance(points) > 0.1]
worst_m = np.abs(field.distance(points) - np.minimum(room.distance(points), 2.0)).max()
print(f"{len(points)} free points: the field is off by at most {1000 * worst_m:.0f} mm (voxels of 50 mm)")

outside = field.distance(np.array([[100.0, 0.0, 0.0]]))[0]
print(f"100 m away, in unknown space, the distance is {outside}")

editor = Editor(field)
before = editor.snapshot()
changed = editor.apply(Edit("no-fly", solids.Box((2.7, 0.8, 0.0), (3.3, 1.6, 2.0)), name="camera tripod"))
unchanged = np.array_equal(before.values_m[:20], editor.field.values_m[:20])
share = np.prod(changed.shape) / field.values_m.size
print(f"a no-fly zone recomputed {100 * share:.0f} % of the voxels; those far from it are untouched: {unchanged}")

shown = {"mapped": before, "with a no-fly zone": editor.field}
figure = plot.slices({title: pictures.axis_slice(each, "z", 1.2) for title, each in shown.items()})
OUT.mkdir(parents=True, exist_ok=True)
figure.savefig(OUT / "distance_field.png", dpi=130)
print(f"wrote {OUT / 'distance_field.png'}")
