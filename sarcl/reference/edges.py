"""Echoes of edges by short elements: Michaeli's currents less those of physical optics, element by element."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..scattering.physical_optics import UP, polarisation

BESIDE_POLE = 1e-5  # rad: where both currents are infinite, their difference is taken at either side


def edge_echo(
    ends: np.ndarray,
    frame: tuple[np.ndarray, np.ndarray, float],
    frequencies: np.ndarray,
    antennas: tuple[np.ndarray, np.ndarray],
    reference_range: float,
    *,
    up: tuple[float, float, float] = UP,
    seen: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    per_wavelength: float = 20,
) -> np.ndarray:
    """Echo of one edge of a conductor, complex128 (n_f, 2, 2) [r, t], m: 0 is H and 1 is V.

    ends  m (2, 3);  frame  of its wedge: inward, normal, number, as sarcl.scene.wedges has them
    antennas  places of transmitter and receiver, m (3,) each;  reference_range  m
    seen  (places, antenna) -> whether it sees them (n,); None: it does
    per_wavelength  elements, each a plane wave with the directions and the path of its own middle
    """
    (tx, rx), way = antennas, ends[1] - ends[0]
    n = int(np.linalg.norm(way) * per_wavelength * frequencies.max() / SPEED_OF_LIGHT) + 1
    places = ends[0] + (np.arange(n) + 0.5)[:, None] / n * way
    looks = [unit(end - places) for end in (tx, rx)]
    received = polarisation(-looks[1], up)
    matrix = np.empty((n, 2, 2), complex)
    for t, field in enumerate(polarisation(-looks[0], up)):
        current = fringe(frame, looks[0], looks[1], field)
        for r in range(2):
            matrix[:, r, t] = (received[r] * current).sum(axis=1) / (2 * np.sqrt(np.pi))
    if np.array_equal(tx, rx):
        matrix = (matrix + matrix.swapaxes(1, 2)) / 2
    if seen is not None:
        matrix *= (seen(places, tx) & seen(places, rx))[:, None, None]
    path = np.linalg.norm(places - tx, axis=1) + np.linalg.norm(places - rx, axis=1) - 2 * reference_range
    k = 2 * np.pi * frequencies / SPEED_OF_LIGHT
    turn = ((looks[0] + looks[1]) @ way / n)[:, None] * k
    wave = np.exp(-1j * k * path[:, None]) * np.sinc(turn / (2 * np.pi)) * np.linalg.norm(way) / n
    return np.einsum("krt,kn->nrt", matrix, wave)


def fringe(
    frame: tuple[np.ndarray, np.ndarray, float], to_tx: np.ndarray, to_rx: np.ndarray, field: np.ndarray
) -> np.ndarray:
    """k K of both faces (n, 3): the total of the formulas of Michaeli 1986 less physical optics, n x H doubled."""
    inward, normal, number = frame
    end = np.pi * number
    other = np.cos(end) * inward + np.sin(end) * normal
    magnetic = np.cross(-to_tx, field)
    angle = np.arctan2(to_tx @ normal, to_tx @ inward) % (2 * np.pi)
    out = np.zeros((len(to_tx), 3), complex)
    for x, out_of, phi in (
        (inward, normal, angle), (other, np.sin(end) * inward - np.cos(end) * normal, end - angle)
    ):  # fmt: skip
        t = np.cross(x, out_of)
        cosine = -to_tx @ t
        sine = np.sqrt(1 - cosine**2)
        mu = (to_rx @ x + cosine / sine * (to_rx @ t - cosine)) / sine
        beside = np.abs(np.cos(phi) + mu) < BESIDE_POLE
        sides = []
        for step in (-BESIDE_POLE, BESIDE_POLE):
            cos_alpha = np.where(beside, np.cos(phi + step), -mu)
            alpha = np.arccos(cos_alpha + 0j)
            gap = np.cos(phi / number) - np.cos(alpha / number)
            h_t, e_t = magnetic @ t, field @ t
            hard = 2j / (number * sine) * np.sin(alpha / number) / (np.sin(alpha) * gap)
            soft = -2 / number * np.sin(phi / number) / gap
            along = -1j * (cosine * h_t * (2 / number - 1j * cos_alpha * sine * hard) + e_t * soft) / sine**2
            optics = 2j / (sine * (np.cos(phi) - cos_alpha)) * (phi < np.pi)
            total = (h_t * hard)[:, None] * x + along[:, None] * t
            sides.append(total - optics[:, None] * np.cross(out_of, magnetic))
        out += (sides[0] + sides[1]) / 2
    return np.where((angle <= end)[:, None], out, 0)
