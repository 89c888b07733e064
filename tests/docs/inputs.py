"""What a reader of the documentation has before a block: files that are put into an empty folder, by name."""

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

import esdf
import vehicle
from esdf import solids
from flight import Waypoints, file_format, flight_log, project
from mapping import map_folder
from tests.docs.inputs_of_others import InputsOfOthers
from tests.goshawk.running import run
from tests.journeys import inputs as journeys

MadeOnce = Callable[[str, Callable[[Path], None]], Path]
SURVEYED = "map_x_m,map_y_m,map_z_m,x_m,y_m,z_m"
ROOT = Path(__file__).parents[2]


class Inputs(InputsOfOthers):
    """`put(name, folder)` puts what is called so into the folder; what takes long is made once for all tests."""

    def __init__(self, made_once: MadeOnce, pillar_map: Path) -> None:
        self._made_once, self._pillar_map = made_once, pillar_map

    def put(self, name: str, folder: Path) -> None:
        getattr(self, name.replace("-", "_"))(folder)

    def demo_out(self, folder: Path) -> None:
        """The project that `goshawk demo` leaves."""
        shutil.copytree(self._demo(), folder / "demo-out")

    def demo_map(self, folder: Path) -> None:
        """The demo's map with its images, its camera file, its vehicle and waypoints."""
        made = self._demo()
        for name in ("map", "rendered"):
            shutil.copytree(made / name, folder / name)
        for name in ("vehicle.toml", "waypoints.json", "rendered/camera.toml"):
            shutil.copy(made / name, folder)

    def second_walk(self, folder: Path) -> None:
        """A few of the images again, as somebody's who walks there later."""
        for image in sorted((folder / "rendered").rglob("000?.png")):
            place = folder / "walk" / image.relative_to(folder / "rendered")
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(image, place)

    def surveyed(self, folder: Path) -> None:
        """Points of the map, and where they were measured."""
        points = ((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 2.0, 0.0), (0.0, 2.0, 1.0))
        rows = [f"{x},{y},{z},{x + 10.0},{y - 4.0},{z + 2.0}" for x, y, z in points]
        (folder / "surveyed.csv").write_text("\n".join([SURVEYED, *rows, ""]))

    def two_maps(self, folder: Path) -> None:
        """Two parts of that map that overlap."""
        for name, box in (("hall", "-9,-9,-9,2,9,9"), ("corridor", "-2,-9,-9,9,9,9")):
            run("map", "crop", folder / "map", "--box", box, "--out", folder / name)

    def slow(self, folder: Path) -> None:
        """A slow trajectory through the demo's waypoints."""
        made = folder / "demo-out"
        world = ("--map", made / "map", "--vehicle", made / "vehicle.toml")
        run("plan", made / "waypoints.json", *world, "--speed", 3, "--out", folder / "slow.json")

    def _demo(self) -> Path:
        return self._made_once("documented_demo", lambda out: run("demo", "--out", out / "demo-out")) / "demo-out"

    def map(self, folder: Path) -> None:
        """A map of a room with two pillars, and the walk that it was recorded along."""
        shutil.copytree(self._pillar_map, folder / "map")
        x = np.linspace(0.8, 5.2, 24)
        rows = (f"{i}.png,{0.5 * i},{x[i]:.3f},{0.8 + 0.02 * i:.3f},1.2,1,0,0,0" for i in range(len(x)))
        (folder / "map" / "poses.csv").write_text("\n".join(["image,time_s,x_m,y_m,z_m,qw,qx,qy,qz", *rows, ""]))

    def hall(self, folder: Path) -> None:
        """A map of an empty hall of 8 by 8 m round the origin."""
        self.map(folder)
        room = solids.Scene([solids.Room((-4.0, -4.0, -0.5), (4.0, 4.0, 4.0))])
        grid = esdf.Grid.covering((-4.2, -4.2, -0.7), (4.2, 4.2, 4.2), 0.1)
        shutil.rmtree(folder / "map" / "esdf")
        field = esdf.build(esdf.rasterize(room, grid), grid)
        esdf.save(folder / "map" / "esdf", field)
        body = {"hash": field.hash, "verdict": "good", "reasons": []}
        file_format.write_toml(folder / "map" / "map.toml", format=map_folder.FORMAT, version=1, body=body)

    def vehicle(self, folder: Path) -> None:
        """A vehicle file from a data sheet: no rotor drag."""
        journeys.with_vehicle(folder)
        (folder / "quad.toml").rename(folder / "vehicle.toml")

    def waypoints(self, folder: Path) -> None:
        """Three waypoints in that room."""
        (folder / "waypoints.csv").write_text(journeys.WAYPOINTS)

    def walk(self, folder: Path) -> None:
        """A checked trajectory in that room."""
        self.waypoints(folder)
        world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
        run(
            "plan", folder / "waypoints.csv", *world, "--speed", 1, "--acceleration", 1.5, "--out", folder / "walk.json"
        )

    def lap(self, folder: Path) -> None:
        """The same, of another name."""
        self.walk(folder)
        (folder / "walk.json").rename(folder / "lap.json")

    def missions(self, folder: Path) -> None:
        """Two missions in that room, one that can be flown again and again."""
        (folder / "missions").mkdir()
        for name, y in (("there", 2.2), ("across", 2.0)):
            points = np.array([[0.8, 0.8, 1.0], [3.0, y, 1.3], [5.2, 1.2, 1.0]])
            project.save_waypoints(folder / "missions" / f"{name}.json", Waypoints(points, np.full(3, np.nan)))

    def logs(self, folder: Path) -> None:
        """Two flights of a vehicle with rotor drag, and where a page has them."""
        (folder / "flights").mkdir(exist_ok=True)
        for name, log in (("a", journeys.lap()), ("b", journeys.other_flight())):
            flight_log.save(folder / f"{name}.parquet", log)
            flight_log.save(folder / "flights" / f"{name}.parquet", log)
        flight_log.save(folder / "held_out.parquet", journeys.other_flight())

    def turning_flights(self, folder: Path) -> None:
        """The flights of the example, and its vehicle's file."""
        spec = importlib.util.spec_from_file_location("example", ROOT / "examples" / "05_find_a_missing_effect.py")
        assert spec is not None
        assert spec.loader is not None
        example = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(example)
        seeds = {"rotation": 0, "yaw_doublets": 1, "oblique": 2, "doublets": 9, "yaw_sweep": 10}
        for name, seed in seeds.items():
            flight_log.save(folder / f"{name}.parquet", example.fly(name, seed))
        vehicle.save(folder / "vehicle.toml", example.known)
