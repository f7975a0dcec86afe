"""Echoes of edges by short elements: Michaeli's currents less those of physical optics, element by element; and waves
from border to border of a face, from the elements of one of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..scattering.physical_optics import polarisation

BorderFrame: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, float, float]
# ln of the variable of integration, on whose scale integrands are smooth
NODES = np.arange(-16.0, 1.7, 0.1)
BESIDE_POLE = 1e-5  # rad: where both currents are infinite, their difference is taken at either side


def edge_echo(
    ends: np.ndarray,
    frame: tuple[np.ndarray, np.ndarray, float],
    frequencies: np.ndarray,
    antennas: tuple[np.ndarray, np.ndarray],
    reference_range: float,
    *,
    seen: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    per_wavelength: float = 20,
    window: tuple[float, float] = (-np.inf, np.inf),
) -> np.ndarray:
    """Echo of one edge of a conductor, complex128 (n_f, 2, 2) [r, t], m: 0 is H and 1 is V.

    ends  m (2, 3);  frame  of its wedge: inward, normal, number, as sarcl.scene.wedges has them
    antennas  places of transmitter and receiver, m (3,) each;  reference_range  m
    seen  (places, antenna) -> whether it sees them (n,); None: it does
    per_wavelength  elements, each a plane wave with the directions and the path of its own middle
    window  least and greatest half path about the reference range, m, of the elements that count
    """
    (tx, rx), way = antennas, ends[1] - ends[0]
    n = int(np.linalg.norm(way) * per_wavelength * frequencies.max() / SPEED_OF_LIGHT) + 1
    places = ends[0] + (np.arange(n) + 0.5)[:, None] / n * way
    looks = [unit(end - places) for end in (tx, rx)]
    received = polarisation(-looks[1])
    matrix = np.empty((n, 2, 2), complex)
    for t, field in enumerate(polarisation(-looks[0])):
        current = fringe(frame, looks[0], looks[1], field)
        for r in range(2):
            matrix[:, r, t] = (received[r] * current).sum(axis=1) / (2 * np.sqrt(np.pi))
    if np.array_equal(tx, rx):
        matrix = (matrix + matrix.swapaxes(1, 2)) / 2
    if seen is not None:
        matrix *= (seen(places, tx) & seen(places, rx))[:, None, None]
    path = np.linalg.norm(places - tx, axis=1) + np.linalg.norm(places - rx, axis=1) - 2 * reference_range
    matrix *= ((path >= 2 * window[0]) & (path <= 2 * window[1]))[:, None, None]
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
    for x, out_of, phi in ((inward, normal, angle), (other, np.sin(end) * inward - np.cos(end) * normal, end - angle)):
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


def border_echo(
    borders: np.ndarray,
    frame: BorderFrame,
    frequencies: np.ndarray,
    antennas: tuple[np.ndarray, np.ndarray],
    reference_range: float,
    *,
    seen: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    per_wavelength: float = 20,
    window: tuple[float, float] = (-np.inf, np.inf),
) -> np.ndarray:
    """Echo of the waves between two borders of a face, both ways, complex128 (n_f, 2, 2) [r, t], m.

    borders  start and end of both, m (2, 2, 3), each along inward x normal of its own
    frame    inward of both, normal of the face, number of both;  the rest as in edge_echo
    """
    out = np.zeros((len(frequencies), 2, 2), complex)
    x1, x2, normal, number1, number2 = frame
    for lines, faces in ((borders, frame), (borders[::-1], (x2, x1, normal, number2, number1))):
        one, other, size = _elements(lines, faces, antennas, per_wavelength * frequencies.max() / SPEED_OF_LIGHT)
        if not size:
            continue
        g, k = unit((other - one).sum(axis=0)), 2 * np.pi * frequencies[:, None] / SPEED_OF_LIGHT
        length = np.linalg.norm(other - one, axis=1)
        path = np.linalg.norm(one - antennas[0], axis=1) + length + np.linalg.norm(other - antennas[1], axis=1)
        path -= 2 * reference_range
        phase = k * path
        wave = np.exp(-1j * phase[:, 1::2]) * np.sinc((phase[:, 2::2] - phase[:, :-1:2]) / (2 * np.pi)) * size
        wave *= (path[1::2] >= 2 * window[0]) & (path[1::2] <= 2 * window[1])
        one, other, phase = one[1::2], other[1::2], k * length[1::2]
        fields, detours, factor = [], [], 1j * np.sqrt(phase / (2 * np.pi))
        ends = zip((one, other), antennas, faces[:2], faces[3:], (g, -g), strict=True)
        for place, antenna, x, number, way in ends:
            look, t = unit(antenna - place), np.cross(x, normal)
            fields.append([np.cross(-look, e) @ t for e in polarisation(-look)])
            phi, end = np.arctan2(look @ normal, look @ x) % (2 * np.pi), np.pi / number
            keller = 2 / number * np.sin(end) / (np.cos(phi / number) - np.cos(end)) * np.cos(phi / 2) ** 2
            detours.append(1 + look @ way)
            sine = np.linalg.norm(np.cross(look, t), axis=1)
            factor = factor * keller * np.sqrt(2 * sine * (way @ x) / detours[-1]) * (phi <= np.pi * number)
            factor = factor if seen is None else factor * seen(place, antenna)
        across, along = unit(x1 - x2), np.cross(unit(faces[0] - faces[1]), normal)
        factor = factor / (np.abs(g @ across) * (np.cross(faces[0], normal) @ along) ** 2)
        wave *= factor * _spectrum(*(np.sqrt(phase * one) for one in detours))
        out += np.einsum("kn,rn,tn->krt", wave, np.array(fields[1]), np.array(fields[0]))
    return out


def _elements(
    borders: np.ndarray, frame: BorderFrame, antennas: tuple[np.ndarray, np.ndarray], density: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Corners and middles, in turns, of elements of the first border, and where rays from there meet the second, m
    (2 n + 1, 3) each; length of the elements of the mean of both along the bisector, m, 0 where no ray meets it.

    density  elements per metre
    """
    g, (a, b), (c, d) = _stationary_ray(borders, frame, antennas), *borders
    beside = np.cross(g, frame[2])
    met = ((borders[0] - c) @ beside) / ((d - c) @ beside)  # share of the second border at either end of the first
    low, high = np.sort(np.clip((np.array([0, 1]) - met[0]) / np.diff(met), 0, 1))
    n = int((high - low) * np.linalg.norm(b - a) * density) + 1
    share = (low + (high - low) * np.arange(2 * n + 1) / (2 * n))[:, None]
    one, other = a + share * (b - a), c + (met[0] + share * np.diff(met)) * (d - c)
    is_met = g @ frame[0] > 0 > g @ frame[1]
    along = np.cross(unit(frame[0] - frame[1]), frame[2])
    return one, other, float(is_met) * float(np.abs((one[-1] + other[-1] - one[0] - other[0]) @ along) / 2 / n)


def _stationary_ray(borders: np.ndarray, frame: BorderFrame, antennas: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Direction along the face from the first border to the second in which the path over both is stationary, for
    antennas in the directions from the middle of both borders; found by halving."""
    x1, x2, normal, *_ = frame
    middle = borders.reshape(4, 3).mean(axis=0)
    looks = [unit(end - middle) for end in antennas]
    t = np.cross(unit(x1 - x2), normal)
    steps = [way / (way @ t) for way in (borders[0, 1] - borders[0, 0], borders[1, 1] - borders[1, 0])]
    feet = [line[0] - (line[0] - middle) @ t * step for line, step in zip(borders, steps, strict=True)]

    def rise(angle: float) -> float:  # of the path, where border 1 is left at -s and border 2 met at s
        s = np.tan(angle)
        g = unit(feet[1] + s * steps[1] - feet[0] + s * steps[0])
        return float(g @ (steps[0] + steps[1]) + looks[0] @ steps[0] - looks[1] @ steps[1])

    low, high = -np.pi / 2 + 1e-12, np.pi / 2 - 1e-12
    for _ in range(60):
        turn = (low + high) / 2
        low, high = (turn, high) if rise(turn) < 0 else (low, turn)
    s = np.tan(low)
    return unit(feet[1] + s * steps[1] - feet[0] + s * steps[0])


def _spectrum(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """exp(-j pi/4)/pi integral a b exp(-v^2)/[(a^2 - j v^2)(b^2 - j v^2)] dv over all real v, turned by pi/8: the plane
    waves along a face, with the poles of both antennas."""
    out = np.zeros(a.shape, complex)
    for v in np.exp(NODES + 0.125j * np.pi):
        out += np.exp(-(v**2)) * v / ((a**2 - 1j * v**2) * (b**2 - 1j * v**2))
    return 2 * (NODES[1] - NODES[0]) * np.exp(-0.25j * np.pi) / np.pi * a * b * out
