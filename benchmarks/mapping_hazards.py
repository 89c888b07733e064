"""Thin rods, a cable, a plain wall and a net: what a map of images shows of them, and what it calls free."""

import dataclasses
import time

import numpy as np
import report

from esdf import FREE, OCCUPIED
from esdf.solids import Cylinder
from flight import FloatArray
from goshawk.rendered import safety, thin
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping.camera.rig import Camera
from mapping.dense import resolution, surface
from mapping.dense.surface import ImageView

INSTANTS, SHARE = 32, 0.52
"""Of the loop: the half of the room with the hazards."""
NET_INSTANTS, NET_SHARE = 24, 0.39
"""Of the part with the net."""
BARS = {"pole": 0.01, "cable of 12 mm": 0.10, "cable of 6 mm": 0.20, "net": 0.05}
LARGEST_LOSS = 0.02
WIDTHS_PX = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0)


def rows() -> list[report.Row]:
    """Thin rods, a cable and a plain wall: what a map of images shows of them, and what it calls free."""
    views = hazardous_views(rendered_room.RODS)
    started_s = time.process_time()
    result = surface.reconstruct(views)
    cpu_s = time.process_time() - started_s
    cameras = [(view.camera, view.T_world_camera) for view in views]
    seen = resolution.visibility(result.state, result.grid, cameras)
    found = safety.score(result.state, result.grid, seen, result.inferred)
    row, shown = report.row, found.wall.occupied + found.wall_inferred
    return [
        row(f"dense, {len(views)} images", cpu_s, "CPU s"),
        row("3 cm pole: occupied", 100 * found.pole.occupied, "%", ">= 80", found.pole.occupied >= 0.8),
        row("3 cm pole: free", 100 * found.pole.free, "%"),
        row("12 mm cable: occupied", 100 * found.cable.occupied, "%"),
        row("12 mm cable: free", 100 * found.cable.free, "%"),
        row("plain wall: occupied", 100 * found.wall.occupied, "%"),
        row("plain wall: occupied or inferred", 100 * shown, "%", ">= 70", shown >= 0.7),
        row("inferred voxels", int(result.inferred.sum()), ""),
        row("of them, not within 10 cm of matter", 100 * found.inferred_not_near_matter, "%"),
        row("10 cm behind it: free", 100 * found.behind_wall.free, "%", "<= 1", found.behind_wall.free <= 0.01),
        row("space marked free", found.free_m3, "m3"),
        row(
            "free voxels inside matter",
            1e6 * found.free_share_in_matter,
            "ppm",
            "<= 200",
            found.free_share_in_matter <= 2e-4,
        ),
        row("distance > 10 cm too large", 100 * found.overstated, "%", "<= 0.3", found.overstated <= 0.003),
        row(
            "of it, near what the mask calls resolved",
            100 * found.overstated_unexplained,
            "%",
            "0",
            found.overstated_unexplained == 0.0,
        ),
        *by_width("rods", rendered_room.RODS, result, cameras),
        *other_rods(),
        *contradicted("with a net", thin.scene()),
        *contradicted("without", rendered_room.furnished()),
    ]


def contradicted(name: str, room: rendered_room.RenderedScene) -> list[report.Row]:
    """The same without and with the contradictions by images: what is free inside things, and the price."""
    flight = rendered_world.loop_flight(NET_INSTANTS, share=NET_SHARE)
    views = thin.views(room, rendered_world.default_rig(), flight.T_world_body)
    depths = list(surface.depth_images(views, surface.StereoOptions()))
    taken = surface.DenseOptions()
    cpu_s, states = [], []
    for options in (dataclasses.replace(taken, contradicted=False), taken):
        shown = surface.measured(surface.fuse(views, depths, options), options)
        started_s = time.process_time()
        states.append(surface.extract(shown, views, depths, options))
        cpu_s.append(time.process_time() - started_s)
    before, after = states
    free = (before.state == FREE).sum()
    lost = float(((before.state == FREE) & (after.state != FREE)).sum() / free)
    rows = [
        report.row(f"{name}: free space lost", 100 * lost, "%", "<= 2", lost <= LARGEST_LOSS),
        report.row(f"{name}: contradictions, {len(views)} images", cpu_s[1] - cpu_s[0], "CPU s"),
    ]
    if room == rendered_room.furnished():
        return rows
    shares = thin.free_inside(before.state, before.grid), thin.free_inside(after.state, after.grid)
    for thing, share in shares[1].items():
        bar = BARS["pole" if thing.startswith("pole") else thing]
        rows += [
            report.row(f"{thing}: free without them", 100 * shares[0][thing], "%"),
            report.row(f"{thing}: free", 100 * share, "%", f"<= {100 * bar:g}", share <= bar),
        ]
    return rows


def other_rods() -> list[report.Row]:
    """The same room with rods in other places, on which no bound was chosen."""
    views = hazardous_views(rendered_room.OTHER_RODS)
    result = surface.reconstruct(views)
    cameras = [(view.camera, view.T_world_camera) for view in views]
    return by_width("other rods", rendered_room.OTHER_RODS, result, cameras)


def hazardous_views(rods: tuple[Cylinder, ...]) -> list[ImageView]:
    """Images of the hazardous room with their true poses."""
    scene, rig = rendered_room.hazardous(rods), rendered_world.default_rig()
    flight = rendered_world.loop_flight(INSTANTS, share=SHARE)
    return [
        ImageView(
            camera,
            T @ camera.T_body_camera,
            rendered_world.render(
                camera,
                T,
                scene=scene,
                seed=len(rig) * i + number,
                gain=rendered_world.GAIN * rendered_world.exposure_change(i, number),
            ),
        )
        for i, T in enumerate(flight.T_world_body)
        for number, camera in enumerate(rig)
    ]


def by_width(
    name: str, rods: tuple[Cylinder, ...], result: surface.Reconstruction, cameras: list[tuple[Camera, FloatArray]]
) -> list[report.Row]:
    """Share of the rods called free, by how many pixels wide the best image with a line of sight shows them."""
    one_pixel = resolution.visibility(result.state, result.grid, cameras, pixels=1.0)
    width_px, free, occupied = [], [], []
    for rod in rods:
        points = safety.axis(rod)
        inside = result.grid.contains(points)
        state = result.state[tuple(result.grid.index(points[inside]).T)]
        width_px.append(2.0 * rod.radius_m / one_pixel.finest(points[inside]))
        free.append(state == FREE)
        occupied.append(state == OCCUPIED)
    width, free, occupied = (np.concatenate(part) for part in (width_px, free, occupied))
    table = []
    for low, high in zip(WIDTHS_PX, (*WIDTHS_PX[1:], np.inf), strict=True):
        chosen = (width >= low) & (width < high)
        if chosen.sum() >= 50:
            which = f"{name} {low:g} to {high:g} px wide ({chosen.sum()} cm)"
            table.append(report.row(f"{which}: free", 100 * free[chosen].mean(), "%"))
            table.append(report.row(f"{which}: occupied", 100 * occupied[chosen].mean(), "%"))
    return table


if __name__ == "__main__":
    report.main(rows)
