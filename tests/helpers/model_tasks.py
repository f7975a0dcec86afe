"""Random legal tasks of models: fields of arrays, orbits, terrain, scenes, shadows, pointing, scenarios, forecasts."""

from __future__ import annotations

from typing import Any

import numpy as np

import sarcl
from sarcl.reference.equations import field as exact_field
from sarcl.scenario.scenario import Scenario, loads

from . import task_inputs as inputs
from .tasks import Draw, expect, finite, near

C = inputs.C


def beam(draw: Draw) -> None:
    """Fields against the sum over elements."""
    f0, bandwidth = inputs.band(draw)
    array = inputs.array(draw, C / f0, bandwidth)
    away = inputs.distance(draw)
    shape = draw.pick((draw.whole(1, 50),), (draw.whole(1, 8), draw.whole(1, 8)), ())
    positions = draw.normal(*shape, 3) * away
    times = draw.pick(0.0, 1.0) * away / C + draw.random.random(draw.pick((), (draw.whole(1, 9),))) / bandwidth
    reference, allowed = draw.pick(np.zeros(3), draw.normal(3) * away), inputs.tolerance(draw, 1e-9)
    found = sarcl.beam(
        array, f0, times=times, positions=positions, reference=reference, tolerance=allowed, device=inputs.device(draw),
        max_bytes=draw.pick(None, draw.log(8e5, 1e8)),
    )  # fmt: skip
    elements = np.asarray(array.positions, np.longdouble) + reference  # 1e-9 m are 3e-5 of the shortest wavelength
    wanted = exact_field(elements, array.offsets_at(0), array.weights, f0, times, positions)
    finite(found, "field")
    expect(found.shape == wanted.shape, f"shape {found.shape}, wanted {wanted.shape}")
    off = float(np.abs(found - wanted).max()) / float(np.abs(array.weights).sum())
    expect(off <= allowed, f"a field is off by {off:.3g}, allowed {allowed:.3g}")


def array_factor(draw: Draw) -> None:
    """The closed form of one carrier is the sum over elements; diverse carriers with no step are one carrier."""
    shape = draw.whole(1, 40), draw.whole(1, 5)
    f0 = draw.log(1e6, 1e12)
    spacing = C / f0 * draw.normal(2)
    ky = draw.random.uniform(-1, 1, 20)
    kz = np.sqrt(1 - ky**2) * draw.random.uniform(-1, 1, 20)
    found = sarcl.array_factor.constant_factor(f0, shape=shape, spacing=spacing, cosines=(ky, kz))
    k = 2 * np.pi * f0 / C
    wanted = sum(
        np.exp(1j * k * (n * spacing[0] * ky + p * spacing[1] * kz)) for n in range(shape[0]) for p in range(shape[1])
    )
    near(found, wanted, 1e-9, shape[0] * shape[1] * np.sqrt(20), "array factor")
    same = sarcl.array_factor.diverse_factor(
        f0, shape=shape, spacing=spacing, frequency_step=(0.0, 0.0), cosines=(ky, kz), retarded=draw.normal()
    )
    near(same, wanted, 1e-9, shape[0] * shape[1] * np.sqrt(20), "array factor")


def ambiguity(draw: Draw) -> None:
    """1 at no delay and no shift, nowhere larger, and the same at opposite points."""
    signal = draw.noise(draw.whole(1, 200)) * draw.log(1e-9, 1e9)
    found = sarcl.ambiguity(signal, draw.log(1, 1e10))
    values = found.magnitude
    finite(values, "ambiguity")
    near(values.max(), 1.0, 1e-9, what="peak")
    shifts = found.dopplers[:, None] + found.dopplers
    there = np.abs(shifts).min(axis=0) < 1e-9 * np.abs(found.dopplers).max()  # the lowest shift may have no opposite
    near(values[:, there], values[::-1, ::-1][:, there[::-1]], 1e-9, what="opposite points")


def orbit(draw: Draw) -> None:
    """Positions on the ground have the range and the zero-Doppler time that they were asked for."""
    made = sarcl.Orbit.kepler(
        draw.pick(6.9e6, 7.2e6, 4.2164e7, 6.378e6 + draw.log(1e5, 4e7)), draw.pick(0.0, draw.log(1e-6, 0.5)),
        draw.uniform(0, np.pi), node=draw.uniform(-7, 7), argument_of_perigee=draw.uniform(-7, 7),
        mean_anomaly=draw.uniform(-7, 7), j2=draw.chance(0.5), span=draw.pick(None, (-100.0, 100.0)),
    )  # fmt: skip
    finite(made.positions(0.0), "position")
    t = draw.uniform(-50, 50)
    height = float(np.linalg.norm(made.positions(t))) - 6.378e6
    horizon = np.sqrt(height * (height + 2 * 6.378e6))
    r = height + (horizon - height) * draw.uniform(0.01, 0.99)
    track = made.trajectory(
        center=t, prf=draw.log(1, 1e4), n_pulses=draw.whole(1, 20), look=draw.uniform(0, 1),
        attitude=draw.pick("zero-doppler", "yaw", "orbital"), side=draw.pick("right", "left"),
    )  # fmt: skip
    finite(track.attitude, "attitude")
    side = draw.pick("right", "left")
    ground = made.geolocate(t, r, heights=draw.pick(0.0, 1000.0), side=side)
    seen = made.view(t, ground)
    near(seen.slant_range, r, 1e-9, what="range")
    expect(abs(seen.range_rate) < 1e-3, f"range rate {seen.range_rate}")
    _, distance = made.locate(ground, span=(t - 20, t + 20))
    expect(distance <= r * (1 + 1e-9), f"range {distance} after {r}")


def terrain(draw: Draw) -> None:
    """Heights at the points of an elevation model are its own; grids on it are where it is."""
    n, m = draw.whole(2, 8), draw.whole(2, 8)
    step = draw.log(1e-6, 1)
    longitude = draw.uniform(-180, 180) + np.arange(m) * step
    latitude = draw.uniform(-85, 75) + np.arange(n) * step * draw.pick(1, -1)
    height = draw.normal(n, m) * 500
    height[draw.random.random((n, m)) < draw.pick(0, 0.2)] = np.nan
    model = sarcl.ElevationModel(longitude, latitude, height)
    found = model.heights_at(*np.meshgrid(longitude, latitude))
    known = np.isfinite(height)
    near(found[known], height[known], 1e-7, what="heights")
    expect(np.isnan(found[~known]).all(), "heights where there are none")
    spacing = model.spacing * draw.log(0.1, 3)
    grid = sarcl.ImageGrid.on_terrain(model, spacing, frame=draw.pick("local", "ecef"))
    finite(grid.positions[~grid.empty] if grid.empty is not None else grid.positions, "positions")


def scenes(draw: Draw) -> None:
    """Facets keep their area when they are split and moved; terrain has its heights."""
    scene = inputs.facets(draw, draw.log(1e-3, 1e6))

    def area(one: Any) -> float:
        a, b = (one.triangles[:, i] - one.triangles[:, 0] for i in (1, 2))
        return float(np.linalg.norm(np.cross(a, b), axis=1).sum())

    size = float(np.ptp(scene.bounds, axis=0).max())
    near(area(scene.split(size * draw.uniform(0.2, 2))), area(scene), 1e-9, what="area")
    by = draw.normal(3) * size
    near(scene.moved(by).bounds, scene.bounds + by, 1e-12, what="bounds")
    finite(scene.realized(draw.whole(1, 99)).triangles, "triangles")
    earth = scene.on_earth(draw.uniform(-180, 180), draw.uniform(-90, 90), draw.normal() * 100)
    near(area(earth), area(scene), 1e-6 + 1e-8 * 6.4e6 / size, what="area")


def shadows(draw: Draw) -> None:
    """Lit shares lie between 0 and 1."""
    scene = inputs.facets(draw, draw.log(1e-2, 1e3))
    size = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    n = draw.whole(1, 8)
    track = sarcl.Trajectory(None, scene.center + inputs.positions(draw, n, size * draw.log(1.5, 1e4)))
    tx = track.positions
    found = sarcl.illumination.lit(scene.triangles, tx, device=inputs.device(draw))
    share = np.asarray(found.fraction_at(draw.whole(1, n) - 1), float)
    expect(((share >= 0) & (share <= 1)).all(), f"shares {share.min()} to {share.max()}")


def aiming(draw: Draw) -> None:
    """Attitudes are rotations, gains are finite and no more than at the peak, and tracks have their speed."""
    track = inputs.track(draw, draw.whole(1, 12), inputs.distance(draw), timed=draw.chance(0.7))
    how = draw.pick("fixed", "spotlight", "stripmap")
    if how == "fixed":
        track = sarcl.pointing.fixed(track, draw.normal(3))
    elif how == "spotlight":
        track = sarcl.pointing.spotlight(track, draw.normal(3))
    else:
        track = sarcl.pointing.stripmap(track, draw.uniform(0, 3), squint=draw.uniform(-1.5, 1.5))
    steered = sarcl.pointing.steered(track, draw.uniform(-3, 3), draw.uniform(-1.5, 1.5))
    for one in (track.attitude, steered.attitude):
        near(one @ np.swapaxes(one, 1, 2), np.broadcast_to(np.eye(3), one.shape), 1e-9, what="attitude")
    antenna = inputs.antenna(draw)
    gain = antenna.gain(draw.normal(50, 3), draw.log(1e6, 1e12))
    finite(gain, "gain")
    if antenna.kind != "table":  # whose spline may reach above its values
        expect(np.abs(gain).max() <= antenna.amplitude * (1 + 1e-6), f"gain {np.abs(gain).max()}")
    if track.times is not None and len(track) > 3:
        finite(sarcl.effective_velocity(track, draw.normal(3)).speed, "speed")


def earth(draw: Draw) -> None:
    where = draw.uniform(-180, 180), draw.uniform(-90, 90), draw.pick(-1, 1) * draw.log(1e-3, 4e7) % 4e7
    found = sarcl.wgs84.geodetic(sarcl.wgs84.ecef(*where))
    near(found[1:], where[1:], 1e-9, what="latitude and height")
    expect(abs((found[0] - where[0] + 180) % 360 - 180) < 1e-9 or abs(where[1]) > 89.999, f"longitude {found[0]}")


def pulses(draw: Draw) -> None:
    """Spectra of pulses: at most 1 in modulus, and |P|^2 after the filter."""
    pulse = inputs.waveform(draw)
    f = pulse.center + pulse.bandwidth * draw.random.uniform(-1, 1, 40)
    p = pulse.pulse_spectrum(f)
    finite(p, "spectrum")
    expect(np.abs(p).max() <= 1 + 1e-9, f"modulus {np.abs(p).max()}")
    near(pulse.matched_spectrum(f), np.abs(p) ** 2, 1e-9, np.sqrt(40), "matched spectrum")


def scenario(draw: Draw) -> None:
    """A scenario says the same as its text, and makes what the calls make."""
    waveform, n = {"chirp": {"center": draw.log(1e8, 1e11), "bandwidth": 1e7, "duration": 1e-6}}, draw.whole(1, 12)
    tables: dict[str, Any] = {
        "waveform": waveform,
        "trajectory": {
            "circle": {"radius": draw.log(10, 1e5), "height": draw.log(1, 1e5), "arc": draw.log(1e-3, 6), "n_pulses": n}
        },
        "scene": {
            "points": [{"positions": draw.normal(draw.whole(1, 4), 3).tolist()} for _ in range(draw.whole(1, 3))]
        },
        "grid": {"plane": {"shape": [draw.whole(1, 12), draw.whole(1, 12)], "spacing": draw.log(1e-3, 10)}},
        "echo": {"tolerance": inputs.tolerance(draw, 1e-5), "polarization": draw.pick("HH", "VV")},
    }
    if draw.chance(0.3):
        tables["array"] = {"linear": {"n": draw.whole(1, 3), "spacing": 0.01, "frequency_step": draw.pick(0.0, 1e5)}}
    if draw.chance(0.2):
        tables["noise"] = {"variance": draw.log(1e-6, 1)}
    tables[draw.pick("backproject", "polar_format")] = {"tolerance": inputs.tolerance(draw, 1e-5)}
    first = Scenario(**tables)
    second = loads(first.dumps())
    expect(second.dumps() == first.dumps(), "the text differs")
    raw, again = first.simulate(), second.simulate()
    expect(np.array_equal(raw.samples[:], again.samples[:]), "echoes differ")
    image = first.focus(raw)
    finite(image.data, "image")
    expect(np.array_equal(image.data, second.focus(again).data), "images differ")


def fullwave(draw: Draw) -> None:
    """Forecasts of full-wave echoes: finite, or refused."""
    center = draw.log(1e6, 1e12)
    wavelength, n = C / center, draw.whole(1, 20)
    size = wavelength * draw.random.uniform(0.05, 1.5, 3)
    scene = draw.pick(sarcl.shapes.box(size), sarcl.shapes.cylinder(size[0], size[1]), sarcl.shapes.plate(size[:2]))
    track = inputs.track(draw, n, wavelength * draw.log(3, 1e6))
    chirp = sarcl.Waveform.chirp(center=center, bandwidth=center * draw.log(1e-3, 0.5), duration=100 / center)
    found = sarcl.plan(
        sarcl.fullwave_echo, scene, chirp, track, **draw.pick({}, {"polarization": "all"}, {"cells": 12})
    )
    finite(
        [found.seconds, found.bytes, *(found.plan[name] for name in ("runs", "run_bytes", "run_seconds"))], "forecast"
    )
    str(found)


VERBS = {
    "beam": (60, beam), "array_factor": (15, array_factor), "ambiguity": (15, ambiguity), "orbit": (40, orbit),
    "elevation model": (25, terrain), "scene": (30, scenes), "illumination": (20, shadows), "pointing": (30, aiming),
    "wgs84": (10, earth), "waveform": (15, pulses), "scenario": (30, scenario), "fullwave": (3, fullwave),
}  # fmt: skip
