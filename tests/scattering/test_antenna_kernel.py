"""Antenna patterns of kernels/pattern.clh, in float32, against their twin sarcl/model/antenna_pattern.py."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.antenna_cases import FC, everyone, measured
from helpers.kernel_probe import probe
from scipy.spatial.transform import Rotation

from sarcl.model.antenna import Antenna
from sarcl.model.antenna_pattern import SLACK

BODY = """fv im, a = LOAD(i, x), b = LOAD(i, x + n), c = LOAD(i, x + 2 * n);
if (AXES) to_antenna(table + AXES, &a, &b, &c);
fv re = pattern_gain(table, a, b, c, RATIO / 1024.0f, &im);
STORE(re, i, out); STORE(im, i, out + n);"""


def run(device, antenna, directions, ratio=1.0, axes=None):
    """Complex gains (n,) on a device, packed for FC, at FC ratio; with axes (3, 3), directions are the scene's."""
    table = antenna.packed(FC)
    macros = {"RATIO": round(1024 * ratio), "AXES": 0 if axes is None else len(table)}
    if axes is not None:
        table = np.concatenate([table, axes.T.astype(np.float32).ravel()])
    with pytest.MonkeyPatch.context() as patch:
        re, im = probe(
            device,
            patch,
            BODY,
            directions.T.astype(np.float32),
            2,
            ("common.clh", "pattern.clh"),
            table=table,
            **macros,
        )
    return re.astype(float) + 1j * im


def directions(n, concentrated=3):
    """Unit vectors (n, 3), most of them near boresight, some behind; the last ones on the axes."""
    random = np.random.default_rng(5)
    off, turn = np.pi * random.uniform(0, 1, n) ** concentrated, random.uniform(0, 2 * np.pi, n)
    d = np.stack([np.cos(off), np.sin(off) * np.cos(turn), np.sin(off) * np.sin(turn)], axis=-1)
    d[-6:] = np.concatenate([np.eye(3), -np.eye(3)])
    return d


def clear_of_edges(antenna, d, ratio):
    """True where a float32 angle cannot fall to the other side of a table's edge, or of an aperture's plane."""
    if antenna.kind != "table":
        return (np.abs(d[:, 0]) > 1e-6) | (antenna.kind != "aperture")
    keep = np.ones(len(d), bool)
    r = antenna.ratio(FC * ratio)
    angles = np.arctan2(d[:, 1], d[:, 0]) * r, np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1])) * r
    for angle, axis in zip(angles, (antenna.azimuth, antenna.elevation), strict=True):
        slack = SLACK * (axis[1] - axis[0])
        for edge in (axis[0] - slack, axis[-1] + slack):
            keep &= np.abs(angle - edge) > 2e-6
    return keep


@pytest.mark.parametrize("ratio", [1.0, 0.875])
@pytest.mark.parametrize("name", everyone())
def test_the_error_of_a_device_s_gain_is_within_its_bound(device, name, ratio):
    antenna = everyone()[name]
    d = directions(20011)
    got, wanted = run(device, antenna, d, ratio), antenna.gain(d, FC * ratio)
    keep = clear_of_edges(antenna, d, ratio)
    assert keep.mean() > 0.99 and np.abs(wanted[keep]).max() > 0.9
    assert np.abs(got - wanted)[keep].max() < antenna.error(FC * ratio)


def test_the_error_of_a_narrow_beam_grows_with_its_slope(device):
    antenna = Antenna.rectangular(size=(12, 1), gain_db=45, taper=0.3)
    random = np.random.default_rng(6)
    d = np.concatenate([np.ones((20000, 1)), random.normal(size=(20000, 2)) * (0.003, 0.03)], axis=1)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    axes = Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix()  # small components are differences of large ones
    off = np.abs(run(device, antenna, d @ axes.T, axes=axes) - antenna.gain(d, FC)) / antenna.amplitude
    assert off.max() < antenna.error(FC)
    assert off.max() > 0.05 * antenna.error(FC)  # the bound means something


def test_a_table_of_the_whole_sphere_holds_to_its_seam_and_poles(device):
    a, e = np.linspace(-np.pi, np.pi, 181), np.linspace(-np.pi / 2, np.pi / 2, 91)
    x, y = np.cos(e) * np.cos(a[:, None]), np.cos(e) * np.sin(a[:, None])
    antenna = Antenna.table(a, e, np.exp(x + 0.5j * y - 1) + 0 * e)
    d = directions(20011, concentrated=1)
    got, wanted = run(device, antenna, d), antenna.gain(d, FC)
    peak = np.abs(wanted).max()
    assert np.abs(got - wanted).max() < antenna.error(FC) * peak
    # and the table is the function, to its spline's error
    exact = np.exp(d[:, 0] + 0.5j * d[:, 1] - 1)
    assert np.abs(wanted * exact[-6] / wanted[-6] - exact).max() < 1e-5


def test_the_smallest_table_is_a_cubic(device):
    axis = np.linspace(-0.3, 0.3, 4)
    values = (1 + axis[:, None] - 2 * axis[:, None] ** 3) * (1 - axis**2 + 1j * axis)
    antenna = Antenna.table(axis, axis, values, gain_db=6.0)
    random = np.random.default_rng(7)
    a, e = random.uniform(-0.3, 0.3, (2, 3001))
    d = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)
    wanted = 10**0.3 * (1 + a - 2 * a**3) * (1 - e**2 + 1j * e) / np.abs(values).max()
    assert np.abs(run(device, antenna, d) - wanted).max() < 8e-6


def test_vectors_of_the_scene_turn_into_antenna_axes(device):
    axes = Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix()
    d = directions(1001)
    body = """fv a = LOAD(i, x), b = LOAD(i, x + n), c = LOAD(i, x + 2 * n); to_antenna(table, &a, &b, &c);
    STORE(a, i, out); STORE(b, i, out + n); STORE(c, i, out + 2 * n);"""
    with pytest.MonkeyPatch.context() as patch:
        got = probe(
            device, patch, body, d.T.astype(np.float32), 3, ("common.clh", "pattern.clh"),
            table=axes.T.astype(np.float32).ravel(),
        )  # fmt: skip
    assert np.abs(got.T - d @ axes).max() < 4e-7


def test_numbers_of_a_table_are_its_spline_s_and_nothing_else():
    antenna = measured()[0]
    packed = antenna.packed(FC)
    n, m = packed[8:10].view(np.int32)
    assert (n, m) == antenna.values.shape and len(packed) == 16 + 2 * (n + 2) * (m + 2)
