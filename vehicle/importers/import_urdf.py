"""Mass, inertia and rotor places from a URDF: all links make one body, those called prop or rotor are the rotors."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from flight import FloatArray, FormatError, InputError, errors
from flight.units import RAD_S_PER_RPM
from vehicle.draft import Known
from vehicle.parameters import Parameter

LARGEST_BYTES = 10_000_000
MOST_LINKS = 1000
ROTOR = re.compile(r"prop|rotor", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Link:
    """One rigid part, in the axes of the whole."""

    name: str
    mass_kg: float
    centre_m: FloatArray
    """(3,) centre of mass in the root's axes; of a link without mass, its origin. Of a propeller, the hub."""
    inertia_kg_m2: FloatArray
    """(3, 3) about `centre_m`, the root's axes."""


def read(path: Path) -> Known:
    """One body from all links of a URDF.

    Raises:
        InputError: no such file, or not one root, four rotors and a mass.
        FormatError: it is not a URDF, or an unsafe one (XML entities, too large).
    """
    path = Path(path)
    robot = _robot(path)
    links = _links(robot, path)
    total_kg = sum(link.mass_kg for link in links)
    if not total_kg > 0.0:
        raise InputError(f"{path}: no link has a mass; add <inertial><mass value=.../></inertial>")
    centre = sum(link.mass_kg * link.centre_m for link in links) / total_kg
    inertia = np.zeros((3, 3))
    for link in links:
        arm = link.centre_m - centre
        inertia += link.inertia_kg_m2 + link.mass_kg * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    source = f"URDF {path.name}"
    rotors = [link for link in links if ROTOR.search(link.name)]
    if len(rotors) != 4:
        named = ", ".join(link.name for link in rotors) or "none"
        raise InputError(
            f"{path}: four links with prop or rotor in their names are expected, found {len(rotors)} ({named})"
        )
    hubs = np.array([link.centre_m for link in rotors]) - centre
    if len(np.unique(np.round(hubs[:, :2], 5), axis=0)) < 4:
        raise InputError(f"{path}: the four rotors are not at four places; their joints need an <origin xyz=...>")
    extra = robot.find("properties")
    known = {} if extra is None else _properties(extra.attrib, source)
    parameters = {
        f"inertia_{a}_kg_m2": Parameter(float(inertia[i, i]), 0.0, "kg m2", source)
        for i, a in enumerate(("xx", "yy", "zz"))
    }
    notes = [
        f"rotors 0 to 3 are {', '.join(link.name for link in rotors)} of {path.name}",
        "a URDF has no rotor spins: neighbours are taken to turn opposite ways, the front left one clockwise",
    ]
    return Known(
        name=re.sub(r"[^\w.-]+", "-", robot.get("name") or path.stem),
        mass_kg=Parameter(total_kg, 0.0, "kg", source),
        hub_body_m=np.round(hubs, 6) + 0.0,
        spin=_alternating(hubs),
        rotor_radius_m=known.pop("rotor_radius_m", None),
        parameters=parameters | known,
        notes=tuple(notes),
    )


def parsed(path: Path, tag: str, kind: str) -> ElementTree.Element:
    """The root of an XML file that declares no entities.

    Raises:
        InputError: no such file.
        FormatError: it is not safe XML of this kind.
    """
    if not path.is_file():
        raise errors.missing(path)
    if path.stat().st_size > LARGEST_BYTES:
        raise FormatError(f"{path} has {path.stat().st_size} bytes; a {kind} has less than {LARGEST_BYTES}")
    data = path.read_bytes()
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data or b"\0" in data:  # entities can grow without bound; also in UTF-16
        raise FormatError(f"{path} declares XML entities or is not UTF-8; a {kind} needs neither: remove them")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not valid XML: {error}") from None
    if root.tag != tag:
        raise FormatError(f"{path} is XML but no {kind}: its first tag is <{root.tag}>, not <{tag}>")
    return root


def _robot(path: Path) -> ElementTree.Element:
    robot = parsed(path, "robot", "URDF")
    if any("xacro" in element.tag for element in robot.iter()):
        raise FormatError(f"{path} is a xacro file: make a URDF of it first (xacro IN > OUT.urdf)")
    return robot


def _links(robot: ElementTree.Element, path: Path) -> list[Link]:
    """All links in the axes of the root link."""
    elements = {link.get("name", ""): link for link in robot.findall("link")}
    if not elements or len(elements) > MOST_LINKS:
        raise FormatError(f"{path} has {len(elements)} links; from 1 to {MOST_LINKS} are expected")
    parents: dict[str, tuple[str, FloatArray]] = {}
    for joint in robot.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            raise FormatError(f"{path}: joint {joint.get('name')} has no parent or no child")
        parents[child.get("link", "")] = (parent.get("link", ""), _origin(joint, path))
    return [_link(name, element, _to_root(name, parents, elements, path), path) for name, element in elements.items()]


def _to_root(
    name: str, parents: Mapping[str, tuple[str, FloatArray]], elements: Mapping[str, ElementTree.Element], path: Path
) -> FloatArray:
    T, seen = np.eye(4), {name}
    while name in parents:
        name, step = parents[name]
        if name in seen or name not in elements:
            raise FormatError(f"{path}: the joints of link {name} form a ring or name a link that is not there")
        seen.add(name)
        T = step @ T
    return T


def _link(name: str, element: ElementTree.Element, T: FloatArray, path: Path) -> Link:
    inertial = element.find("inertial")
    if inertial is None:
        return Link(name, 0.0, T[:3, 3], np.zeros((3, 3)))
    mass = inertial.find("mass")
    mass_kg = _number(mass, "value", path) if mass is not None else 0.0
    if mass_kg < 0.0:
        raise InputError(f"{path}: link {name} has a mass of {mass_kg:g} kg; it must be zero or more")
    tensor = inertial.find("inertia")
    own = np.zeros((3, 3))
    if tensor is not None:
        for i, a in enumerate("xyz"):
            for j, b in enumerate("xyz"):
                own[i, j] = _number(tensor, f"i{min(a, b)}{max(a, b)}", path, default=0.0)
    there = T @ _origin(inertial, path)
    return Link(name, mass_kg, there[:3, 3], there[:3, :3] @ own @ there[:3, :3].T)


def _origin(element: ElementTree.Element, path: Path) -> FloatArray:
    """(4, 4) of the <origin> inside; R = Rz(yaw) Ry(pitch) Rx(roll)."""
    T, origin = np.eye(4), element.find("origin")
    if origin is None:
        return T
    T[:3, 3] = _three(origin.get("xyz", "0 0 0"), path)
    r, p, y = _three(origin.get("rpy", "0 0 0"), path)
    cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
    T[:3, :3] = (
        np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        @ np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        @ np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    )
    return T


def _three(text: str, path: Path) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != 3 or not np.isfinite(values).all():
        raise FormatError(f"{path}: {text!r} is not three finite numbers")
    return values


def _number(element: ElementTree.Element, name: str, path: Path, *, default: float | None = None) -> float:
    text = element.get(name)
    if text is None and default is not None:
        return default
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FormatError(f"{path}: <{element.tag} {name}={text!r}> is not a finite number")
    return value


def _properties(given: Mapping[str, str], source: str) -> dict[str, Parameter]:
    """The properties that gym-pybullet-drones adds to its URDFs: thrust and torque coefficient, propeller radius."""
    wanted = {
        "kf": ("thrust_quadratic.k_n_s2", "N s2"),
        "km": ("rotor_yaw_torque.torque_n_m_s2", "N m s2"),
        "prop_radius": ("rotor_radius_m", "m"),
    }
    per_rpm2 = RAD_S_PER_RPM**-2
    found = {}
    for name, (ours, unit) in wanted.items():
        try:
            value = float(given.get(name, ""))
        except ValueError:
            continue
        found[ours] = Parameter(value * (per_rpm2 if name in ("kf", "km") else 1.0), 0.0, unit, f"{source}, {name}")
    return found


def _alternating(hubs: FloatArray) -> FloatArray:
    """Spins of neighbours going round, the one nearest to front left clockwise."""
    angle = np.arctan2(hubs[:, 1], hubs[:, 0])
    first = int(np.argmin(np.abs(np.angle(np.exp(1j * (angle - np.pi / 4))))))
    around = np.argsort(np.mod(angle - angle[first] + 1e-6, 2.0 * np.pi))
    spin = np.empty(4)
    spin[around] = [-1.0, 1.0, -1.0, 1.0]
    return spin
