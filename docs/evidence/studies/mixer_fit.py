"""Fits the constants of the mixer's initial value, prints the errors, draws the figure.

python docs/evidence/studies/mixer_fit.py     writes docs/pictures/mixer_initial_value.svg
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from sysid.report import drawing

Array = NDArray[np.float64]
USED = (0.4614, 0.668, 0.395)
"""In firmware_bridge/controller/src/control/mixer.c."""
NEWTON = (0.5, 1.0, 1.0)
"""One Newton step from the solution without lateral speed."""
PICTURE = Path(__file__).parents[2] / "pictures" / "mixer_initial_value.svg"


def induced_velocity(axial: Array, lateral2: Array) -> Array:
    """Eq. (2) for a load of 1, by bisection: v sqrt((v_z + v)^2 + v_xy^2) = 1."""
    low, high = np.zeros_like(axial), np.full_like(axial, 4.0)
    for _ in range(90):
        middle = 0.5 * (low + high)
        above = middle * np.sqrt((axial + middle) ** 2 + lateral2) > 1.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)


def initial_value(constants: tuple[float, float, float], axial: Array, lateral2: Array) -> Array:
    c0, c1, c2 = constants
    half = 0.5 * axial
    middle = np.sqrt(half**2 + 1.0)
    w = middle + half
    through = w - c0 * lateral2 * (middle - half) / (w**2 + c1 + c2 * lateral2)
    return 1.0 / np.sqrt(through**2 + lateral2)


def chebyshev(v: Array, axial: Array, lateral2: Array) -> Array:
    """One step of third order on eq. (2)."""
    w = axial + v
    q = w**2 + lateral2
    rise = np.sqrt(q) / (q + v * w)
    bend = -(rise**3) / np.sqrt(q) * (2.0 * w + v * lateral2 / q)
    missing = 1.0 - v * np.sqrt(q)
    return v + rise * missing + 0.5 * bend * missing**2


def main() -> None:
    axial, lateral2 = np.meshgrid(
        np.concatenate([np.linspace(-1.0, 1.0, 81), np.linspace(1.05, 12.0, 60)]),
        np.concatenate([[0.0], np.logspace(-3, 4, 160)]),
        indexing="ij",
    )
    true = induced_velocity(axial, lateral2)

    def worst(constants: tuple[float, float, float], *, stepped: bool = False) -> float:
        v = initial_value(constants, axial, lateral2)
        v = chebyshev(v, axial, lateral2) if stepped else v
        return float(np.abs(v / true - 1.0).max())

    fit = optimize.minimize(worst, USED, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10})
    print(f"fitted again: {np.round(fit.x, 4)}")
    for name, constants in (("Newton", NEWTON), ("used", USED), ("fitted again", tuple(fit.x))):
        print(f"{name:14}{100 * worst(constants):8.3f} %   after one step {worst(constants, stepped=True):.1e}")

    figure, ((left, right),) = drawing.figure(1, 2, (8.0, 3.2))
    lateral = np.logspace(-1.5, 1.5, 200)
    for value in (-1.0, -0.5, 0.0, 1.0, 3.0):
        z = np.full_like(lateral, value)
        exact = induced_velocity(z, lateral**2)
        start = initial_value(USED, z, lateral**2)
        left.semilogx(lateral, 100 * (start / exact - 1.0), label=f"$v_z$ = {value:g}")
        right.loglog(lateral, np.abs(chebyshev(start, z, lateral**2) / exact - 1.0) + 1e-12)
    drawing.plain(left, "", "$v_{xy}$ / root of load", "error of the initial value (%)")
    drawing.plain(right, "", "$v_{xy}$ / root of load", "relative error after one step")
    right.set_ylim(1e-10, 1e-4)
    left.legend(frameon=False, fontsize=8)
    drawing.written(figure, PICTURE)


if __name__ == "__main__":
    main()
