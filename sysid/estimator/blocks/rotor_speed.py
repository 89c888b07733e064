"""Rotor speed: as it most likely was, from rotor speed as it was measured. It drives the model.

Its noise is an error in a regressor: it is in the torque the model expects and
not in the motion, so a plain fit finds the motion too small for the torque and books that as inertia: 2 to 3 % too much
with 4 rad/s at 200 Hz, five times the stated error. Put in its place what the true speed is expected to be given the
whole measured signal, and what is still wrong with it is uncorrelated with what the fit sees: the bias is gone
(regression calibration; Carroll et al., Measurement Error in Nonlinear Models, 2006, chapter 4).
For white noise that expectation is Wiener's smoother, S_true S_measured^-1 = 1 - noise S_measured^-1, with the joint
spectrum S of all rotors, because roll, pitch, yaw and thrust differ in how much of them is noise.
"""

import numpy as np
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

from flight.rotations import FloatArray
from sysid.estimator.sampling import Stretch, interval_means

QUANTITY = "rotor_speed_rad_s"

SEGMENT_S = 1.28
"""Spectra are resolved to 0.8 Hz, narrower than what motors and controller make of a flight."""
SHORTEST_SEGMENT = 16
"""Samples."""
LEAST_SEGMENTS = 8
"""Without overlap; fewer say too little about the joint spectrum of four rotors."""
LEAST_SHARE = 0.5
"""Where less of the power than this is the rotors', nothing is passed: their share is not known well enough there."""


def read(stretch: Stretch) -> tuple[FloatArray, FloatArray]:
    """(n - 1, 4) mean speed and mean acceleration over each interval."""
    time_s, speed = stretch.samples(QUANTITY)
    return interval_means(time_s, most_likely(time_s, speed), stretch.time_s)


def most_likely(time_s: FloatArray, speed: FloatArray) -> FloatArray:
    """Expected true speeds (n, rotors), of evenly sampled measured ones with white noise of unknown size.

    The noise is read off the quietest quarter of the band, where motors no longer follow. A signal too short for a
    spectrum comes back as it is.
    """
    n = len(speed)
    length = 2 * round(0.5 * min(SEGMENT_S / float(np.median(np.diff(time_s))), n / LEAST_SEGMENTS))
    if length < SHORTEST_SEGMENT:
        return speed
    frames = ShortTimeFFT(hann(length, sym=False), length // 4, fs=1.0)
    mean = speed.mean(axis=0)
    shares = frames.stft((speed - mean).T, padding="odd")
    spectrum = np.einsum("ift,jft->fij", shares, shares.conj()) / shares.shape[2]
    power, axes = np.linalg.eigh(spectrum)
    kept = 1.0 - _noise(power) / np.maximum(power, np.finfo(float).tiny)
    kept[kept < LEAST_SHARE] = 0.0
    passed = np.einsum("fik,fk,fjk->fij", axes, kept, axes.conj())
    return mean + frames.istft(np.einsum("fij,jft->ift", passed, shares), k1=n).T


def _noise(power: FloatArray) -> float:
    """Least mean power of a rotor over any quarter of the band; (bins, rotors) in."""
    width = max(1, len(power) // 4)
    return float(np.convolve(power.mean(axis=1)[1:-1], np.full(width, 1.0 / width), "valid").min())
