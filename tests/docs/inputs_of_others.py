"""Files of other programs that a reader brings: images, videos, recorders' logs, data of vehicles, certificates."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

import vehicle
from esdf import Grid
from esdf.visibility import Visibility, save_visibility
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping import open_map
from mapping.camera import rig as rigs
from mapping.camera import rig_export
from tests.docs.stick_flight import simulated_stick_flight
from tests.journeys import inputs as journeys
from tests.mapping.camera.test_rig_import import EQUI
from tests.mapping.sparse import test_rgbd as rgbd
from tests.sysid.logs.readers import encode_blackbox, test_read_blackbox, test_read_poses
from tests.vehicle import test_draft as sheets_of_others

ROOT = Path(__file__).parents[2]
CAMERA = rigs.forward_camera("SIMPLE_PINHOLE", 320, 240, [228.5, 160.0, 120.0])


class InputsOfOthers:
    """Each method puts what it is called after into the folder."""

    def checkout(self, folder: Path) -> None:
        """What a reader has who stands in a copy of the repository."""
        for name in ("examples", "firmware_bridge"):
            (folder / name).symlink_to(ROOT / name)
        (folder / ".venv").symlink_to(sys.prefix)

    def resolved_map(self, folder: Path) -> None:
        """The map in the folder, of images that resolve 20 mm."""
        grid = open_map(folder / "map").field.grid
        nx, ny, nz = (-(-n // 4) for n in grid.shape)
        coarse = Grid(grid.origin_world_m, (0.2, 0.2, 0.2), (nx, ny, nz))
        finest = np.full(coarse.shape, 0.02, np.float32)
        save_visibility(folder / "map" / "visibility.npz", Visibility(coarse, finest))

    def photographs(self, folder: Path) -> None:
        """Those of an ordinary lens, as `photos`."""
        journeys.with_photographs(folder)

    def camchain(self, folder: Path) -> None:
        (folder / "camchain.yaml").write_text(EQUI)

    def images(self, folder: Path) -> None:
        """Of the two cameras of a rig, with their camera file and the direction of up."""
        rig, flown = rendered_world.default_rig(0.5), rendered_world.loop_flight(20, share=0.25)
        rendered_world.write_rendered_sequence(folder / "images", rig=rig, flight=flown)
        rigs.save(folder / "camera.toml", rig)

    def video(self, folder: Path) -> None:
        """A walk through the same room, and the camera file of the lens."""
        flown = rendered_world.loop_flight(80, share=0.3)
        writer = cv2.VideoWriter(str(folder / "walk.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, (320, 240))
        for i, T_world_body in enumerate(flown.T_world_body):
            grey = rendered_world.render(CAMERA, T_world_body, scene=rendered_room.furnished(), seed=i)
            writer.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
        writer.release()
        rigs.save(folder / "gopro.toml", rigs.Rig((CAMERA,)))

    def depth_images(self, folder: Path) -> None:
        """Those of an RGB-D camera, and its camera file."""
        camera = dataclasses.replace(rgbd.CAMERA, folder=".")
        flown, rig = rendered_world.loop_flight(12, share=0.12), rigs.Rig((camera,))
        rendered_world.write_rendered_sequence(folder / "rgb", rig=rig, flight=flown)
        rigs.save(folder / "kinect.toml", rig)
        made = rgbd.write_depths(folder / "sensor", flown).folder
        (made / rgbd.CAMERA.folder).rename(folder / "depth")

    def odometry(self, folder: Path) -> None:
        """Of the flight that the images were taken on."""
        flown: RenderedFlight = rendered_world.loop_flight(20, share=0.25)
        rig_export.write_tum(folder / "vio.tum", flown.times_s, flown.T_world_body)

    def foreign_csv(self, folder: Path) -> None:
        """A log of another recorder, and the data sheet's vehicle file."""
        journeys.with_foreign_csv(folder)
        journeys.with_vehicle(folder)

    def poses_and_imu(self, folder: Path) -> None:
        """Two files that one clock stamped."""
        test_read_poses.euroc(folder)
        for name, out in (("state_groundtruth_estimate0", "poses.csv"), ("imu0", "imu.csv")):
            (folder / "mav0" / name / "data.csv").rename(folder / out)

    def blackbox(self, folder: Path) -> None:
        log = encode_blackbox.header() + encode_blackbox.frames(test_read_blackbox.rows())
        (folder / "LOG00001.BFL").write_bytes(log)

    def stick_flight(self, folder: Path) -> None:
        """A flight by stick as Betaflight records it without rotor speeds, and the vehicle file from a data sheet."""
        flown = simulated_stick_flight()
        vehicle.save(folder / "my.toml", flown.vehicle)
        (folder / "LOG00001.BFL").write_bytes(flown.blackbox)

    def sheets(self, folder: Path) -> None:
        """What PX4, RotorPy and a URDF say of a vehicle."""
        (folder / "px4.params").write_text(sheets_of_others.PX4)
        journeys.with_ulog(folder)
        import rotorpy.vehicles.hummingbird_params as hummingbird

        (folder / "hummingbird_params.py").write_text(Path(str(hummingbird.__file__)).read_text())
        sheets_of_others.urdf(folder).rename(folder / "quad.urdf")

    def certificate(self, folder: Path) -> None:
        """One for this machine, which signs itself."""
        subprocess.run(
            ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost",
             "-addext", "subjectAltName=DNS:localhost", "-keyout", "station.key", "-out", "station.pem"],
            cwd=folder, check=True, capture_output=True,
        )  # fmt: skip
