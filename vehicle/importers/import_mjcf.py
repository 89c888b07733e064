"""Mass, inertia and rotors from a MuJoCo model (MJCF): the bodies of the vehicle make one, motors on sites are rotors.

https://mujoco.readthedocs.io/en/stable/XMLreference.html
"""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from flight import FloatArray, FormatError, InputError, frames, rotations
from vehicle.draft import Known
from vehicle.importers.import_urdf import parsed
from vehicle.parameters import Parameter

UPRIGHT = 0.999
"""Cosine of a rotor's axis and body z, below which it is tilted."""


@dataclass(frozen=True, slots=True)
class _Part:
    mass_kg: float
    centre_m: FloatArray
    inertia_kg_m2: FloatArray
    """(3, 3) about the centre, in the vehicle's axes."""


def read(path: Path) -> Known:
    """The first body of the world that has a mass, with all that is fixed to it.

    Raises:
        InputError: no such file, no mass, a tilted rotor, or a shape whose inertia no formula gives.
        FormatError: it is not MJCF, or an unsafe one (XML entities, too large).
    """
    path = Path(path)
    root = parsed(path, "mujoco", "MJCF")
    if root.find("include") is not None:
        raise FormatError(f"{path} includes other files: save it as one (mj_saveLastXML)")
    model = _Model(path, root)
    world = root.find("worldbody")
    bodies = [] if world is None else world.findall("body")
    for body in bodies:
        parts = list(model.parts(body, np.eye(4), ""))
        total_kg = sum(part.mass_kg for part in parts)
        if total_kg > 0.0:
            break
    else:
        raise InputError(f"{path}: no body has a mass; add <inertial mass=... diaginertia=.../>")
    centre = np.sum([part.mass_kg * part.centre_m for part in parts], axis=0) / total_kg
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.centre_m - centre
        inertia += part.inertia_kg_m2 + part.mass_kg * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    source = f"MJCF {path.name}"
    hubs, spin, ratio_m, notes = model.rotors(centre)
    return Known(
        name=re.sub(r"[^\w.-]+", "-", root.get("model") or path.stem),
        mass_kg=Parameter(total_kg, 0.0, "kg", source),
        hub_body_m=hubs,
        spin=spin,
        yaw_torque_to_thrust_m=ratio_m,
        parameters={
            f"inertia_{a}_kg_m2": Parameter(float(inertia[i, i]), 0.0, "kg m2", source)
            for i, a in enumerate(("xx", "yy", "zz"))
        },
        notes=notes,
    )


class _Model:
    """Elements with their defaults."""

    def __init__(self, path: Path, root: Element) -> None:
        self._path, self._root = path, root
        self._defaults: dict[tuple[str, str], dict[str, str]] = {}
        for default in root.findall("default"):
            self._take(default, {})
        compiler = root.find("compiler")
        degrees = compiler is None or compiler.get("angle", "degree") == "degree"
        self._angle = math.pi / 180.0 if degrees else 1.0
        self._sites: dict[str, FloatArray] = {}

    def _take(self, default: Element, inherited: dict[str, dict[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in inherited.items()}
        for child in default:
            if child.tag != "default":
                own[child.tag] = own.get(child.tag, {}) | child.attrib
        for tag, values in own.items():
            self._defaults[tag, default.get("class", "")] = values
        for child in default.findall("default"):
            self._take(child, own)

    def _whole(self, element: Element, childclass: str) -> dict[str, str]:
        by_class = self._defaults.get((element.tag, element.get("class", childclass)), {})
        return self._defaults.get((element.tag, ""), {}) | by_class | element.attrib

    def parts(self, body: Element, T: FloatArray, childclass: str) -> Iterator[_Part]:
        """Masses of a body and those in it; its sites are kept. T: of its axes in the first body's."""
        childclass = body.get("childclass", childclass)
        for site in body.findall("site"):
            self._sites[site.get("name", "")] = T @ self._pose(self._whole(site, childclass))
        inertial = body.find("inertial")
        if inertial is not None:
            yield self._inertial(inertial.attrib, T)
        else:
            for geom in body.findall("geom"):
                yield from self._geom(self._whole(geom, childclass), T)
        for child in body.findall("body"):
            yield from self.parts(child, T @ self._pose(child.attrib), childclass)

    def _inertial(self, given: dict[str, str], T: FloatArray) -> _Part:
        there = T @ self._pose(given)
        own = np.diag(self._numbers(given, "diaginertia", "0 0 0", 3))
        if "fullinertia" in given:
            xx, yy, zz, xy, xz, yz = self._numbers(given, "fullinertia", "", 6)
            own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        (mass_kg,) = self._numbers(given, "mass", "", 1)
        return _Part(mass_kg, there[:3, 3], there[:3, :3] @ own @ there[:3, :3].T)

    def _geom(self, given: dict[str, str], T: FloatArray) -> Iterator[_Part]:
        mass = given.get("mass")
        if mass is None:
            raise InputError(
                f"{self._path}: geom {given.get('name', given.get('type'))} has no mass; give its body an <inertial>"
            )
        (mass_kg,) = self._numbers(given, "mass", "", 1)
        if mass_kg == 0.0:
            return
        shape = _SHAPES.get(given.get("type", "sphere"))
        if shape is None:
            raise InputError(f"{self._path}: a {given.get('type')} has a mass; give its body an <inertial>")
        there, size = T @ self._pose(given), self._numbers(given, "size", "", 0)
        if "fromto" in given or len(size) < shape[0]:
            raise InputError(f"{self._path}: a {given.get('type')} without pos and size; give its body an <inertial>")
        own = mass_kg * np.diag(shape[1](*size[: shape[0]]))
        yield _Part(mass_kg, there[:3, 3], there[:3, :3] @ own @ there[:3, :3].T)

    def rotors(self, centre: FloatArray) -> tuple[FloatArray | None, FloatArray | None, float | None, tuple[str, ...]]:
        """Hubs (4, 3), spins (4,) and the ratio of torque to thrust, of motors on sites; None without four."""
        names, hubs, torques = [], [], []
        actuators = self._root.find("actuator")
        for one in [] if actuators is None else actuators:
            given = self._whole(one, "")
            gear = self._numbers(given, "gear", "1 0 0 0 0 0", 6)
            if given.get("site", "") not in self._sites or not gear[:3].any():
                continue
            T = self._sites[given["site"]]
            axis = T[:3, :3] @ gear[:3] / np.linalg.norm(gear[:3])
            if axis[2] < UPRIGHT:
                raise InputError(
                    f"{self._path}: actuator {given.get('name')} pushes along {axis.round(3).tolist()}; only rotors "
                    "along body z can be modelled"
                )
            names.append(given.get("name", given["site"]))
            hubs.append(T[:3, 3] - centre)
            torques.append(gear[5] / np.linalg.norm(gear[:3]))
        turning = np.array(torques)
        if len(hubs) != 4 or (turning == 0.0).any() or abs(np.sign(turning).sum()) == 4:
            return None, None, None, (f"{self._path.name} has no four motors on sites that thrust and twist",)
        order = f"rotors 0 to 3 are {', '.join(names)} of {self._path.name}"
        ratio_m = float(np.abs(turning).mean())
        places = np.round(np.array(hubs, dtype=np.float64), 6)
        return places + 0.0, -np.sign(turning), ratio_m, (order,)  # the body twists against the rotor

    def _pose(self, given: dict[str, str]) -> FloatArray:
        position = self._numbers(given, "pos", "0 0 0", 3)
        if any(name in given for name in ("xyaxes", "zaxis")):
            raise InputError(f"{self._path}: xyaxes and zaxis are not read; give quat or euler")
        q = self._numbers(given, "quat", "1 0 0 0", 4)
        if "euler" in given:
            turns = self._angle * self._numbers(given, "euler", "", 3)
            q = np.array([1.0, 0.0, 0.0, 0.0])
            for axis, turn in zip(np.eye(3), turns, strict=True):  # about the axes that move along
                q = rotations.multiply(q, rotations.exp(turn * axis))
        elif "axisangle" in given:
            axis = self._numbers(given, "axisangle", "", 4)
            q = rotations.exp(self._angle * axis[3] * axis[:3] / max(float(np.linalg.norm(axis[:3])), 1e-12))
        if not np.linalg.norm(q) > 0.0:
            raise FormatError(f"{self._path}: quat {given.get('quat')!r} is none")
        return frames.transform(rotations.normalise(q), position)

    def _numbers(self, given: dict[str, str], name: str, default: str, count: int) -> FloatArray:
        """`count` numbers, or any number of them (0); fewer where MuJoCo fills up with its default."""
        text = given.get(name, default)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = [math.nan]
        rest = [float(word) for word in default.split()]
        values += rest[len(values) : count]
        if (count and len(values) != count) or not np.isfinite(values).all():
            raise FormatError(f"{self._path}: {name}={text!r} is not {count or 'some'} finite numbers")
        return np.array(values)


def _capsule(r: float, h: float) -> tuple[float, float, float]:
    """Per mass; the half spheres' centres are h apart from the middle."""
    share = h / (h + 2.0 * r / 3.0)  # of the cylinder
    ball = 0.4 * r * r + h * h + 0.75 * r * h
    across = share * (3.0 * r * r + 4.0 * h * h) / 12.0 + (1.0 - share) * ball
    return across, across, share * 0.5 * r * r + (1.0 - share) * 0.4 * r * r


_SHAPES: dict[str, tuple[int, Callable[..., tuple[float, float, float]]]] = {
    "box": (3, lambda a, b, c: ((b * b + c * c) / 3.0, (a * a + c * c) / 3.0, (a * a + b * b) / 3.0)),
    "ellipsoid": (3, lambda a, b, c: ((b * b + c * c) / 5.0, (a * a + c * c) / 5.0, (a * a + b * b) / 5.0)),
    "sphere": (1, lambda r: (0.4 * r * r,) * 3),
    "cylinder": (2, lambda r, h: ((3.0 * r * r + 4.0 * h * h) / 12.0,) * 2 + (0.5 * r * r,)),
    "capsule": (2, _capsule),
}
"""How many numbers of `size` a shape has (half lengths), and its moments of inertia per mass."""
