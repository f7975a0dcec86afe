"""Facet physics of kernels/facet.clh, in float32, against its twin sarcl/scattering/physical_optics.py."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.facet_cases import adversarial_phases, facing, random_units
from helpers.kernel_probe import probe

from sarcl.base.constants import EDGE_ON
from sarcl.scattering import physical_optics

HEADERS = ("common.clh", "vec3_complex.clh", "facet.clh")
PERMITTIVITIES = np.array(
    [1, 1.0000012, 1.0000012 - 3.2e-4j, 3, 5 - 2j, 40 - 3j, 80 - 3e3j, 1e9, 1e9 - 1e9j, 1 - 1e9j, np.inf], complex
)


def run(device, body, inputs, n_out):
    """Complex or real outputs of `body` in float64, (n_out, n)."""
    with pytest.MonkeyPatch.context() as patch:
        return probe(device, patch, body, np.asarray(inputs, np.float32), n_out, HEADERS).astype(float)


def load(*names, start=0):
    """OpenCL for vectors x, y, z in rows start, start + 1, ..."""
    each = (
        f"triple {name} = t_make({', '.join(at(start + 3 * i + j) for j in range(3))});" for i, name in enumerate(names)
    )
    return "".join(each)


def at(row):
    return f"LOAD(i, x + {row} * n)"


def store(*values):
    return "".join(f"STORE({value}, i, out + {row} * n);" for row, value in enumerate(values))


def store_complex(*values):
    return store(*(f"{value}.{part}" for value in values for part in ("re", "im")))


def as_complex(rows):
    return rows[::2] + 1j * rows[1::2]


def impedance(permittivity):
    """1/sqrt(eps) in float32, (2, ...), and the permittivity that has just that."""
    eps = np.asarray(permittivity)
    conductor = np.isinf(eps)
    m = np.where(conductor, 0, 1 / np.sqrt(np.where(conductor, 1, eps))).astype(np.complex64)
    return np.stack([m.real, m.imag]), np.where(conductor, np.inf, 1 / np.where(conductor, 1, m.astype(complex)) ** 2)


def phases():
    """Phases in cycles (2, n) float32: adversarial ones, and random ones up to a million, many of them nearly equal."""
    random = np.random.default_rng(1)
    wide = 10.0 ** random.uniform(-6, 6, (2, 60000)) * random.choice([-1, 1], (2, 60000))
    wide[1, ::3] = wide[0, ::3] * (1 + 10.0 ** random.uniform(-8, 0, 20000))
    wide[:, 1::3] = random.uniform(-1, 1, (2, 20000))
    return np.concatenate([adversarial_phases(random).T / (2 * np.pi), wide], axis=1).astype(np.float32)


def test_triangle_mean_errs_less_than_1e_6_at_any_phase(device):
    turns = phases()
    body = f"complex_v r = triangle_mean({at(0)}, {at(1)});" + store_complex("r")
    got = as_complex(run(device, body, turns, 2))[0]
    assert np.abs(got - physical_optics.triangle_mean(*(2 * np.pi * turns.astype(float)))).max() < 1e-6  # gate 1e-5


@pytest.mark.parametrize("largest", [0.05, 3.0, 300.0])
def test_the_rms_error_of_triangle_mean_is_below_2e_7_of_its_rms(device, largest):
    turns = (np.random.default_rng(7).uniform(-largest, largest, (2, 20000)) / (2 * np.pi)).astype(np.float32)
    body = f"complex_v r = triangle_mean({at(0)}, {at(1)});" + store_complex("r")
    got = as_complex(run(device, body, turns, 2))[0]
    wanted = physical_optics.triangle_mean(*(2 * np.pi * turns.astype(float)))
    assert np.linalg.norm(got - wanted) < 2e-7 * np.linalg.norm(wanted)  # facet_plan.KERNEL allows for 5e-7


def test_means_of_phases_beyond_all_bounds_are_next_to_nothing(device):
    most = np.float32(3e38)
    turns = np.array([[most, 1, most, most, np.inf, 1e7], [0.5, -most, most, -most, 0.3, 1e7 + 1]], np.float32)
    body = f"complex_v r = triangle_mean({at(0)}, {at(1)});" + store_complex("r")
    assert (np.abs(run(device, body, turns, 2)) < 1e-6).all()


def test_complex_root_of_numbers_with_real_part_of_at_least_zero(device):
    random = np.random.default_rng(6)
    z = 10.0 ** random.uniform(-12, 12, 500) * np.exp(1j * random.uniform(-np.pi / 2, np.pi / 2, 500))
    z = np.concatenate([z, [0, 1, 4, 2j, -2j]])
    rows = np.stack([np.maximum(z.real, 0), z.imag]).astype(np.float32)
    got = as_complex(run(device, f"complex_v r = c_sqrt(c_make({at(0)}, {at(1)}));" + store_complex("r"), rows, 2))[0]
    wanted = np.sqrt(rows[0].astype(float) + 1j * rows[1].astype(float))
    assert (np.abs(got - wanted) <= 4e-7 * np.abs(wanted)).all()


def test_errors_of_fresnel_coefficients_are_below_1e_6(device):
    random = np.random.default_rng(2)
    cosine = np.concatenate([[0, 1e-30, 1], 10.0 ** random.uniform(-12, 0, 500), random.uniform(0, 1, 500)])
    cosine, eps = (a.ravel() for a in np.meshgrid(cosine.astype(np.float32), PERMITTIVITIES))
    m, exact = impedance(eps)
    body = f"reflection r = fresnel({at(0)}, c_make({at(1)}, {at(2)}));" + store_complex("r.h", "r.v", "r.g")
    h, v, g = as_complex(run(device, body, np.concatenate([cosine[None], m]), 6))
    wanted_h, wanted_v = physical_optics.fresnel(cosine.astype(float), exact)
    assert np.abs(h - wanted_h).max() < 1e-6
    assert np.abs(v - wanted_v).max() < 1e-6
    assert np.abs(g * (1 - cosine.astype(float) ** 2) + wanted_h + wanted_v).max() < 2e-6
    for limit, values in ((1, (0, 0, 0)), (np.inf, (-1, 1, 0))):
        for got, value in zip((h, v, g), values, strict=True):
            assert (got[eps == limit] == value).all()


@pytest.mark.parametrize("up,other", [((0, 0, 1), (0, 1, 0)), ((0, 1, 0), (1, 0, 0)), ((0.6, 0, 0.8), (0, 1, 0))])
def test_polarisation_vectors(device, up, other):
    u = np.concatenate(
        [random_units(np.random.default_rng(3), 2000), [up, np.negative(up), [1e-3, 0, 1], [0, 1e-4, 1]]]
    )
    u = (u / np.linalg.norm(u, axis=1, keepdims=True)).astype(np.float32)
    vectors = (f"(float3)({', '.join(f'{float(a)}f' for a in b)})" for b in (up, other))
    body = load("u") + f"triple h, v; polarisation(u, {', '.join(vectors)}, &h, &v);"
    got = run(device, body + store("h.x", "h.y", "h.z", "v.x", "v.y", "v.z"), u.T, 6)
    sines = np.linalg.norm(np.cross(u, up), axis=1)
    for a, b in zip((got[:3].T, got[3:].T), physical_optics.polarisation(-u.astype(float), up), strict=True):
        # beside `up` H turns with the rounding of the direction, 6e-8
        assert (
            np.abs(a - b) < 5e-7 + 1e-7 / np.maximum(sines, 1e-6 if np.array(up).max() < 1 else 1e-3)[:, None]
        ).all()


def scattering_cases():
    """Normals, directions (n, 3), materials: random, at normal incidence, grazing, facing away, edge-on; float32."""
    random = np.random.default_rng(4)
    normal, u, r = facing(random, 6000)
    u[:500], r[:500] = normal[:500], normal[:500]
    u[500:1000] = normal[500:1000] + 10.0 ** random.uniform(-6, -1, (500, 1)) * random_units(random, 500)
    u[1000:1500] -= (1 - 1e-3) * (u * normal).sum(axis=1)[1000:1500, None] * normal[1000:1500]
    u[1500:2000] *= -1
    r[2000:2500] *= -1
    for end, rows in ((u, slice(2500, 3500)), (r, slice(3000, 4000))):
        cosine = random.uniform(-2 * EDGE_ON, 2 * EDGE_ON, (1000, 1))
        end[rows] += (cosine - (end * normal).sum(axis=1)[rows, None]) * normal[rows]
    r /= np.linalg.norm(r, axis=1, keepdims=True)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    eps = PERMITTIVITIES[random.integers(0, len(PERMITTIVITIES), 6000)]
    return normal.astype(np.float32), u.astype(np.float32), r.astype(np.float32), eps


@pytest.mark.parametrize("antennas", [1, 2])
def test_scattering_matrices_err_by_the_rounding_of_directions(device, antennas):
    normal, u, r, eps = scattering_cases()
    r = u if antennas == 1 else r
    m, exact = impedance(eps)
    up = "(float3)(0, 0, 1), (float3)(0, 1, 0)"
    body = load("k", "u", "r") + f"triple h, v; polarisation(u, {up}, &h, &v); complex_v m = c_make({at(9)}, {at(10)});"
    if antennas == 1:
        body += "scattering s = scatter_back(k, u, h, v, m);"
    else:
        body += f"triple hr, vr; polarisation(r, {up}, &hr, &vr); scattering s = scatter(k, u, h, v, r, hr, vr, m);"
    got = run(device, body + store_complex("s.hh", "s.hv", "s.vh", "s.vv"), np.concatenate([normal.T, u.T, r.T, m]), 8)
    got = as_complex(got).T.reshape(-1, 2, 2)
    n, u, r = (a.astype(float) / np.linalg.norm(a.astype(float), axis=1, keepdims=True) for a in (normal, u, r))
    wanted = physical_optics.scattering_matrix(n, u, r, exact)
    cosine, seen = np.abs((n * u).sum(axis=1)), np.abs((n * r).sum(axis=1))
    # H turns by the rounding of a direction beside `up`; at grazing the cosine's moves R of eps near 1 or huge
    steep = np.where((eps == 1) | np.isinf(eps), 1, np.minimum(np.hypot(*m), np.sqrt(np.abs(1 - 1 / exact))))
    sine = np.minimum(np.linalg.norm(u[:, :2], axis=1), np.linalg.norm(r[:, :2], axis=1))
    bound = 2e-6 + 1e-6 / sine + (3e-7 / (cosine + steep) if antennas == 2 else 0)
    # edge-on to one of two antennas, S fades: 2 |u - r| in 2 EDGE_ON |u - r| rad
    wide = 1.01 * EDGE_ON * np.linalg.norm(u - r, axis=1)
    fades = (np.minimum(cosine, seen) < wide) & (antennas == 2)
    bound[fades] += 3e-7 / EDGE_ON
    assert (np.abs(got - wanted).max(axis=(1, 2)) < bound).all()
    assert antennas == 1 or (fades & (wanted != 0).any(axis=(1, 2))).sum() > 500
    assert (got[1500:2000] == 0).all() and np.abs(wanted).max() > 1.9
    if antennas == 1:
        assert (got[np.isinf(eps)][:, 0, 1] == 0).all() and (got[:, 0, 1] == got[:, 1, 0]).all()
        assert (got[eps == 1] == 0).all()
    else:
        assert (got[2000:2500][~fades[2000:2500]] == 0).all() and (got[(n * r).sum(axis=1) < -wide] == 0).all()
