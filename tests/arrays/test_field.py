"""Fields of arrays: the reference against exact arithmetic, the kernels against the reference, and physics."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, getcontext

import numpy as np
import pytest

import sarcl
from sarcl.model.antenna_array import AntennaArray
from sarcl.opencl.device import Device
from sarcl.reference.equations import field

C = 299_792_458.0
F0 = 10e9
HALF = C / F0 / 2  # half a wavelength, m


def exact(array, t, x, reference=(0.0, 0.0, 0.0), f0=F0, pulse=0):
    """What `beam` should give, by the reference."""
    elements = np.asarray(reference, np.longdouble) + array.positions
    return field(elements, array.offsets_at(pulse), array.weights, f0, np.asarray(t), np.asarray(x))


def error(array, made, wanted):
    return np.abs(made - wanted).max() / np.abs(array.weights).sum()


def around(random, n, distance):
    x = random.normal(size=(n, 3))
    return x * (distance * random.uniform(0.5, 1, n) / np.linalg.norm(x, axis=1))[:, None]


def on_circle(angles, distance):
    return distance * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)


def test_the_reference_holds_against_forty_digits():
    getcontext().prec = 40
    array = AntennaArray.linear(3, spacing=0.015, frequency_step=1e9, weights=[1, 2j, -0.5])
    x, t, origin = np.array([3.1e7, -1.2e7, 0.7]), 0.1234567891, (10.5, 0.25, -3.0)
    total = 0
    for place, offset, weight in zip(array.positions, array.offsets[0], array.weights, strict=True):
        parts = [Decimal(float(a)) - Decimal(b) - Decimal(float(p)) for a, b, p in zip(x, origin, place, strict=True)]
        delay = sum(p * p for p in parts).sqrt() / Decimal(C)
        turns = (Decimal(F0) + Decimal(float(offset))) * (Decimal(t) - delay)
        total += weight * np.exp(2j * np.pi * float(turns % 1))
    assert abs(exact(array, t, x, origin) - total) < 1e-8


@pytest.mark.parametrize("n", [1, 2, 8, 45, 1000, 10_000])
@pytest.mark.parametrize("distance", [1.0, 1e4, 3.6e7])
def test_fields_meet_the_default_tolerance(device, n, distance):
    random = np.random.default_rng(n)
    weights = random.normal(size=n) + 1j * random.normal(size=n)
    array = AntennaArray.linear(n, spacing=0.015, frequency_step=1e9 / n, weights=weights)
    x, reference = around(random, 9, distance), (3.0, -2.0, 1.0)
    t = distance / C + random.uniform(-1e-3, 1e-3, 5)
    made = sarcl.beam(array, F0, times=t, positions=x, reference=reference, device=device)
    assert made.dtype == np.complex64 and made.shape == (5, 9)
    assert error(array, made, exact(array, t, x, reference)) < 1e-6  # a tenth of what was asked


@pytest.mark.parametrize("distance", [1.0, 1e4, 3.6e7])
def test_all_in_phase_does_not_drift(device, distance):
    """10 000 equal terms: the error of plain float32 sums grows with their number."""
    array = AntennaArray(positions=np.zeros((10_000, 3)), offsets=np.zeros((1, 10_000)))
    spread = array.with_offsets(np.linspace(-1e-3, 1e-3, 10_000))  # Hz: not constant, yet in phase for a millisecond
    t, x = np.linspace(0, 1e-3, 9), [[distance, 0, 0], [0.3 * distance, 0.2 * distance, 0]]
    for one in (array, spread):
        assert error(one, sarcl.beam(one, F0, times=t, positions=x, device=device), exact(one, t, x)) < 1e-6


@pytest.mark.parametrize("tolerance", [3e-6, 1e-7, 1e-9])
def test_tighter_tolerances_take_float64(double, tolerance):
    random = np.random.default_rng(3)
    array = AntennaArray.linear(450, spacing=0.015, frequency_step=2e6).mirrored(2, 4)
    x, t = around(random, 7, 1e4), 1e4 / C + random.uniform(-1e-6, 1e-6, 11)
    for pulse in (0, 3):
        made = sarcl.beam(array, F0, times=t, positions=x, pulse=pulse, tolerance=tolerance, device=double)
        assert made.dtype == (np.complex64 if tolerance >= 1e-6 else np.complex128)
        assert error(array, made, exact(array, t, x, pulse=pulse)) < tolerance


def refusal(array, f0, asked):
    """Best tolerance that the refusal of one that cannot be met names."""
    with pytest.raises(ValueError, match="cannot be met") as caught:
        sarcl.beam(array, f0, **asked, tolerance=1e-11)
    return float(str(caught.value).split("best here is ")[1].split()[0])


def test_what_cannot_be_met_names_what_can(device):
    array = AntennaArray.linear(9, spacing=0.015, frequency_step=1e6)
    asked = {"times": [0.1], "positions": [[3.6e7, 0, 0]], "device": device}
    best = refusal(array, F0, asked)
    made = sarcl.beam(array, F0, **asked, tolerance=best)
    assert error(array, made, exact(array, asked["times"], asked["positions"])) < best < 1e-5
    with pytest.raises(ValueError, match="cannot be met"):
        sarcl.beam(array, F0, **asked, tolerance=0.8 * best)
    if not device.info.fp64:
        with pytest.raises(ValueError, match="without float64"):
            sarcl.beam(array, F0, **asked, tolerance=1e-7)


def test_the_best_tolerance_grows_with_the_array_and_the_distance(device):
    def best(array, distance):
        asked = {"times": [distance / C], "positions": [[distance, 0, 0]], "device": device}
        return refusal(array, F0, asked)

    array = AntennaArray.linear(9, spacing=10.0, frequency_step=1e6)
    long = AntennaArray.linear(9, spacing=1e4, frequency_step=1e6)
    near, wide, far = best(array, 1e6), best(long, 1e6), best(array, 1e8)
    assert near <= wide and near < far if device.info.fp64 else near <= far and near < wide


def test_random_fields_err_less_than_asked(device):
    """1 m to 36 000 km, 100 MHz to 100 GHz, elements anywhere within a kilometre, steps up to a tenth of f0. Where a
    tolerance is refused, the best one named is kept."""
    random = np.random.default_rng(10)
    met = refused = 0
    for _ in range(60):
        n, f0 = int(10 ** random.uniform(0, 2.5)), 10 ** random.uniform(8, 11)
        distance, extent = 10 ** random.uniform(0, 7.55), 10 ** random.uniform(-2, 3)
        tolerance = float(random.choice([1e-3, 1e-5, 4.5e-6, 1e-7, 1e-9]))
        array = AntennaArray(
            positions=around(random, n, extent),
            offsets=[random.uniform(-0.1, 0.1, n) * f0],
            weights=random.normal(size=n) + 1j * random.normal(size=n),
        )
        x, origin = around(random, 5, distance), random.normal(size=3) * 10.0 ** random.uniform(-2, 6)
        x += origin
        t = distance / C + random.uniform(-1, 1, 3) * 10.0 ** random.uniform(-9, 0)
        asked = {"times": t, "positions": x, "reference": origin, "device": device}
        try:
            made = sarcl.beam(array, f0, **asked, tolerance=tolerance)
            met += 1
        except ValueError as caught:
            assert "cannot be met" in str(caught)
            refused += 1
            if "best here is " not in str(caught):
                continue
            tolerance = float(str(caught).split("best here is ")[1].split()[0])
            made = sarcl.beam(array, f0, **asked, tolerance=tolerance)
        reach = np.abs(t).max() + np.linalg.norm(x - origin, axis=1).max() / C
        of_reference = 2 * np.pi * (f0 + float(array.offsets.max())) * reach * 1e-18
        assert error(array, made, exact(array, t, x, origin, f0)) < tolerance + of_reference
    assert met >= 25 and refused >= 1


def test_a_point_on_an_element_and_on_the_reference(device):
    array = AntennaArray.linear(4, spacing=0.5, frequency_step=1e8)
    x = np.concatenate([array.positions, array.positions + np.array([1e-7, 0, 0])])
    t = [0.0, 1.3e-8]
    made = sarcl.beam(array, F0, times=t, positions=x, device=device)
    assert error(array, made, exact(array, t, x)) < 1e-6


@pytest.mark.parametrize("n_times, n_points", [(1, 200), (300, 1), (3, 129), (65, 64)])
def test_shapes_and_blocks_do_not_matter(device, n_times, n_points):
    """Lanes along times or points, padded tiles, and blocks of one tile under a small memory limit."""
    random = np.random.default_rng(5)
    array = AntennaArray.linear(450, spacing=0.015, frequency_step=2e6)
    x, t = around(random, n_points, 1e4), random.uniform(0, 1e-4, n_times)
    whole = sarcl.beam(array, F0, times=t, positions=x, device=device)
    small = sarcl.beam(array, F0, times=t, positions=x, device=device, max_bytes=1e6)
    wanted = exact(array, t, x)
    assert error(array, whole, wanted) < 1e-6 and error(array, small, wanted) < 1e-6
    folded = sarcl.beam(array, F0, times=t[:, None], positions=x[None], device=device)
    assert folded.shape == (n_times, 1, 1, n_points) and np.array_equal(folded[:, 0, 0], whole)
    assert sarcl.beam(array, F0, times=t[0], positions=x[0], device=device).shape == ()


@pytest.mark.parametrize("n_times, n_points", [(3, 129), (129, 3)])
def test_tiles_as_wide_as_on_gpus(device, monkeypatch, n_times, n_points):
    """64 lanes a tile, groups as the driver likes them, buffers that are copies."""
    monkeypatch.setattr(Device, "is_cpu", property(lambda self: False))
    random = np.random.default_rng(11)
    array = AntennaArray.linear(70, spacing=0.015, frequency_step=2e6)
    x, t = around(random, n_points, 1e4), random.uniform(0, 1e-4, n_times)
    made = sarcl.beam(array, F0, times=t, positions=x, device=device.one_lane())
    assert error(array, made, exact(array, t, x)) < 1e-6


def test_times_and_ranges_far_apart_are_taken_in_blocks_of_their_own(device):
    """Seconds and a thousand kilometres apart, gigahertz apart: 1e9 cycles, too many for a float32 pair."""
    random = np.random.default_rng(6)
    array = AntennaArray.linear(9, spacing=0.015, frequency_step=1e9)
    t, x = random.uniform(0, 3.0, 20), around(random, 30, 1e6)
    made = sarcl.beam(array, F0, times=t, positions=x, device=device)
    assert error(array, made, exact(array, t, x)) < 1e-6


def test_a_constant_array_is_a_diverse_one_without_steps(device):
    random = np.random.default_rng(8)
    constant = AntennaArray.planar((9, 9), spacing=(HALF, HALF))
    x, t = around(random, 40, 1e4), 1e4 / C + np.linspace(0, 1e-5, 12)
    fast = sarcl.beam(constant, F0, times=t, positions=x, device=device)
    assert error(constant, fast, exact(constant, t, x)) < 1e-6
    nearly = constant.with_offsets(np.arange(81) * 1e-12)  # Hz: not constant to the engine, and yet it is
    assert not nearly.is_constant
    slow = sarcl.beam(nearly, F0, times=t, positions=x, device=device)
    assert error(constant, fast, slow) < 2e-6
    shifted = sarcl.beam(constant.with_offsets(np.full(81, 5e6)), F0, times=t, positions=x, device=device)
    assert error(constant, shifted, sarcl.beam(constant, F0 + 5e6, times=t, positions=x, device=device)) < 1e-6


@pytest.mark.parametrize("distance", [10.0e3, 10.6e3])
@pytest.mark.parametrize("side", [1, -1])
def test_the_beam_points_where_retarded_time_says(device, distance, side):
    """sin(theta) = -(c/(f0 d)) df t' for elements at +n d; Farooq's are at -n d, which changes the sign."""
    array = AntennaArray.linear(8, spacing=HALF, frequency_step=100e3, axis=(0, side, 0))
    angles = np.deg2rad(np.arange(-60, 60, 0.01))
    made = sarcl.beam(array, F0, times=distance / C + 2e-6, positions=on_circle(angles, distance), device=device)
    peak = np.rad2deg(angles[np.argmax(np.abs(made))])
    assert peak == pytest.approx(-23.578 * side, abs=0.02)
    assert np.abs(made).max() == pytest.approx(8, rel=1e-4)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_planar_array_turns_to_30_and_60_degrees(device, sign):
    """Farooq's figure 3.7: at -250 us his array looks to (+30, -60) deg, elevation and azimuth; +250 us turns both.
    Elements at +n d look the other way round."""
    distance = 10e3
    elevation, azimuth = np.deg2rad(np.meshgrid(np.arange(-85, 85, 1.0), np.arange(-85, 85, 1.0), indexing="ij"))
    level = np.cos(elevation)
    x = distance * np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
    for layout in (1, -1):
        array = AntennaArray.planar((9, 9), spacing=(layout * HALF, layout * HALF), frequency_step=(1.5e3, -1e3))
        made = np.abs(sarcl.beam(array, F0, times=distance / C + sign * 250e-6, positions=x, device=device))
        row, column = np.unravel_index(np.argmax(made), made.shape)
        looks = np.rad2deg([elevation[row, column], azimuth[row, column]])
        assert np.allclose(looks, [30 * sign * layout, -60 * sign * layout], atol=0.5)
        assert made.max() == pytest.approx(81, rel=1e-3)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"times": [0.0, float("nan")]}, r"times\[1\] is nan"),
        ({"positions": [[0, 0, float("inf")]]}, r"positions\[0, 2\] is inf"),
        ({"positions": [1, 2]}, r"positions has shape \(2,\), wanted \(..., 3\)"),
        ({"positions": 3.0}, "positions has shape"),
        ({"reference": [0, 0]}, "reference has shape"),
        ({"f0": 0.0}, "carrier must be above 0"),
        ({"f0": float("nan")}, "f0 is nan"),
        ({"f0": 8e6}, "f0 . offset is 0 Hz at element 8"),
        ({"tolerance": 0}, "tolerance"),
        ({"tolerance": 1.5}, "tolerance"),
        ({"max_bytes": 10}, "max_bytes"),
        ({"pulse": -1}, "pulse is -1"),
    ],
)
def test_bad_input_is_named(changes, message):
    good = {"array": AntennaArray.linear(9, spacing=0.015, frequency_step=-1e6), "f0": F0, "times": [0.0]}
    good |= {"positions": [[1e3, 0, 0]]}
    given = good | changes
    with pytest.raises(ValueError, match=message):
        sarcl.beam(given.pop("array"), given.pop("f0"), **given)


def test_other_kinds_and_too_little_memory():
    with pytest.raises(TypeError, match=r"sarcl\.AntennaArray"):
        sarcl.beam(3, F0, times=0, positions=[[1, 0, 0]])
    many = AntennaArray.linear(10_000, spacing=0.015, frequency_step=1e3)
    with pytest.raises(MemoryError, match="max_bytes"):
        sarcl.beam(many, F0, times=0, positions=[[1, 0, 0]], max_bytes=1e6)
    assert sarcl.beam(many, F0, times=[], positions=[[1, 0, 0]]).shape == (0, 1)
    assert sarcl.beam(replace(many, plan=None), F0, times=[0.0], positions=np.zeros((0, 3))).shape == (1, 0)


def test_runs_agree_bit_by_bit(device):
    array = AntennaArray.linear(45, spacing=0.015, frequency_step=20e6)
    x, t = around(np.random.default_rng(9), 100, 5e3), np.linspace(0, 1e-6, 20)
    first = sarcl.beam(array, F0, times=t, positions=x, device=device)
    assert np.array_equal(first, sarcl.beam(array, F0, times=t, positions=x, device=device))
