"""Physical optics and edges of a strip beside the method of moments in two dimensions, without thickness; k = 2 pi."""

import numpy as np
import pytest
from scipy.special import hankel2

from sarcl.scattering.double_diffraction import FaceBorders, double_matrix
from sarcl.scattering.edge_diffraction import WedgeShape, edge_matrix

X, Y, Z = np.eye(3)
K = 2 * np.pi
ANGLE = np.radians(np.arange(0, 61, 2.0)) + 1e-4  # from the normal


def kernels(places, width):
    """Integrals over cells about places of the Hankel function of the distance (n, n)."""
    apart = np.abs(places[:, None] - places)
    node, weight = np.polynomial.legendre.leggauss(40)
    out = sum(w * width / 2 * hankel2(0, K * (apart + a * width / 2 + 2 * width * (apart < width / 2)))
              for a, w in zip(node, weight, strict=True))  # fmt: skip
    own = width * (1 - 2j / np.pi * (np.log(1.781072418 * K * width / 4) - 1))
    return np.where(apart < width / 2, own, out)


def moments(width, is_along):
    """Amplitude per length of a strip by the electric field's integral equation, E along the edges or across."""
    n = int(100 * width)
    cell = width / n
    centers = -width / 2 + (np.arange(n) + 0.5) * cell
    if is_along:  # pulses, matched at points
        wave = np.exp(1j * K * np.outer(centers, np.sin(ANGLE)))
        current = np.linalg.solve(K / 4 * kernels(centers, cell), wave)
        return K / (2 * np.sqrt(np.pi)) * cell * (current * wave).sum(axis=0)
    nodes = centers[1:] - cell / 2  # triangles, charges as pulses between them
    charge = kernels(centers, cell)
    charge = charge[1:, 1:] - charge[1:, :-1] - charge[:-1, 1:] + charge[:-1, :-1]
    wave = np.cos(ANGLE) * np.exp(1j * K * np.outer(nodes, np.sin(ANGLE)))
    current = np.linalg.solve(K / 4 * (kernels(nodes, cell) - charge / (K * cell) ** 2), -wave)
    return -K / (2 * np.sqrt(np.pi)) * cell * (current * wave).sum(axis=0)


def strip(width, is_along):
    """The same by physical optics, and by its edges."""
    looks = np.stack([np.sin(ANGLE), np.cos(ANGLE), 0 * ANGLE], axis=1)
    phase = 2 * K * np.sin(ANGLE) * width / 2
    edges = 0
    for side, inward in ((-1, X), (1, -X)):
        shape = WedgeShape(np.tile(inward, (len(ANGLE), 1)), np.tile(Y, (len(ANGLE), 1)), np.full(len(ANGLE), 2.0))
        edges = edges + edge_matrix(shape, looks, looks, (0, 0, 1))[:, is_along, is_along] * np.exp(1j * side * phase)
    return K / np.sqrt(np.pi) * np.cos(ANGLE) * width * np.sinc(phase / np.pi), edges


def across(width):
    """Waves from edge to edge across the strip, on both sides, E across."""
    looks, n = np.stack([np.sin(ANGLE), np.cos(ANGLE), 0 * ANGLE], axis=1), len(ANGLE)
    ones, out = np.ones((n, 1)), 0
    for x in (X, -X):
        shape = FaceBorders((ones * x, -ones * x), ones * Y, (np.full(n, 2.0), np.full(n, 2.0)))
        phase = np.full((n, 1), K * width)
        out = out + 2 * double_matrix(shape, looks, looks, ones * x, phase, (0, 0, 1))[:, 0, 0, 0]
    return out * np.exp(-1j * K * width)


def rms(values, wanted):
    """dB, over the angles within 25 dB of the peak."""
    level = 20 * np.log10(np.abs(wanted))
    near = level > level.max() - 25
    return np.sqrt(np.mean((20 * np.log10(np.abs(values)) - level)[near] ** 2))


@pytest.mark.parametrize(("width", "along", "across"), [(1.0, 0.2, 3.0), (2.2756, 0.1, 2.8), (4.0, 0.1, 1.6)])
def test_edges_are_those_of_a_strip_but_for_waves_from_edge_to_edge_across_it(width, along, across):
    for is_along, gate in ((1, along), (0, across)):
        wanted, (optics, edges) = moments(width, is_along), strip(width, is_along)
        assert rms(optics + edges, wanted) < gate
        assert rms(optics, wanted) > 3 * rms(optics + edges, wanted)


@pytest.mark.parametrize(("width", "gate"), [(1.0, 0.6), (2.2756, 0.45), (4.0, 0.08), (8.0, 0.02)])
def test_waves_from_edge_to_edge_are_what_edges_lack(width, gate):
    wanted, (optics, edges) = moments(width, 0), strip(width, 0)
    assert rms(optics + edges + across(width), wanted) < gate
    assert rms(optics + edges, wanted) > 3 * gate
