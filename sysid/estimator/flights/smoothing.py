"""A sampled signal as it most likely was, free of its white noise, by a Wiener filter that knows all its channels."""

import numpy as np

from flight.rotations import FloatArray

SEGMENT_S = 1.28
"""Spectra are resolved to 0.8 Hz, narrower than what motors and controller make of a flight."""
SHORTEST_SEGMENT = 16
"""Samples."""
LEAST_SEGMENTS = 8
"""Without overlap; fewer say too little about the joint spectrum of four rotors."""
LEAST_SHARE = 0.5
"""Where less of the power than this is the signal's, nothing is passed: its share is not known well enough there."""


def most_likely(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Expected true values (n, channels), of evenly sampled measured ones with white noise of unknown size.

    For white noise that expectation is Wiener's smoother, S_true S_measured^-1 = 1 - noise S_measured^-1, with the
    joint spectrum S of all channels. The noise is read off the quietest quarter of the band, where the vehicle no
    longer follows. A signal too short for a spectrum comes back as it is.
    """
    from scipy.signal import ShortTimeFFT
    from scipy.signal.windows import hann

    n = len(values)
    length = 2 * round(0.5 * min(SEGMENT_S / float(np.median(np.diff(time_s))), n / LEAST_SEGMENTS))
    if length < SHORTEST_SEGMENT:
        return values
    frames = ShortTimeFFT(hann(length, sym=False), length // 4, fs=1.0)
    mean = values.mean(axis=0)
    shares = frames.stft((values - mean).T, padding="odd")
    spectrum = np.einsum("ift,jft->fij", shares, shares.conj()) / shares.shape[2]
    power, axes = np.linalg.eigh(spectrum)
    kept = 1.0 - _noise(power) / np.maximum(power, np.finfo(float).tiny)
    kept[kept < LEAST_SHARE] = 0.0
    passed = np.einsum("fik,fk,fjk->fij", axes, kept, axes.conj())
    return mean + frames.istft(np.einsum("fij,jft->ift", passed, shares), k1=n).T


def _noise(power: FloatArray) -> float:
    """Least mean power of a channel over any quarter of the band; (bins, channels) in."""
    width = max(1, len(power) // 4)
    return float(np.convolve(power.mean(axis=1)[1:-1], np.full(width, 1.0 / width), "valid").min())
