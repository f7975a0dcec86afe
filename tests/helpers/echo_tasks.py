"""Random legal tasks of echoes: of points, facets and arrays, by every method, and what is done with echoes."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.reference.equations import matched_filter
from sarcl.reference.equations import point_echo as exact_echo
from sarcl.reference.geometry import half_path

from . import task_inputs as inputs
from .tasks import Draw, expect, finite, near, within_report

C = inputs.C
MOST = 3e5  # terms of a sum that is computed whole; larger ones at random samples, by check=True


def setting(draw: Draw, most: int = 12) -> tuple[Any, Any, np.ndarray]:
    """A waveform, a track about some centre, and the centre, m (3,)."""
    center = inputs.origin(draw)
    track = inputs.track(draw, draw.whole(1, most), inputs.distance(draw))
    return inputs.waveform(draw), replace(track, positions=track.positions + center), center


def options_of(draw: Draw, waveform: Any, track: Any, center: np.ndarray) -> dict[str, Any]:
    """Options of `echo` other than arrays."""
    made: dict[str, Any] = {"tolerance": inputs.tolerance(draw, 1e-6), "device": inputs.device(draw)}
    if draw.chance(0.3):
        away = np.linalg.norm(track.positions - center, axis=1).mean()
        made["receiver"] = replace(track, positions=inputs.positions(draw, len(track), away) + center)
    if draw.chance(0.2):
        made["polarization"] = draw.pick("VV", "HV", ["HH", "VV"], "all")
        made["vertical"] = draw.normal(3)
    if draw.chance(0.3):
        cell = C / (2 * waveform.bandwidth)
        width = cell * draw.log(0.1, 300)
        made["range_window"] = (-width * draw.uniform(-0.2, 1), width)
    if draw.chance(0.3):
        made["reference"] = center + draw.normal(3) * draw.log(1e-3, 100)
    if draw.chance(0.2):
        made["radar"] = sarcl.Radar(power=draw.log(1e-3, 1e9), losses_db=draw.uniform(0, 10))
    if draw.chance(0.2):
        made["antenna"] = inputs.antenna(draw, one_way="receiver" in made)
    if draw.chance(0.2):
        made["skip"] = draw.pick(False, {"range window"}, {"zero reflectivity", "facing away", "out of beam"})
    if draw.chance(0.3):
        made["max_bytes"] = draw.log(8e5, 1e9)
    if draw.chance(0.2):
        made["compressed"] = False
    return made


def aimed(track: Any, center: np.ndarray, options: dict[str, Any]) -> Any:
    """The track, and the receiver among the options, pointed at the scene where there is an antenna."""
    if "antenna" not in options:
        return track
    if "receiver" in options:
        options["receiver"] = sarcl.pointing.spotlight(options["receiver"], center)
    return sarcl.pointing.spotlight(track, center)


def size_of(draw: Draw, waveform: Any, samples: float = 2000) -> float:
    """Extent of a scene, m, of at most about so many range cells."""
    return C / (2 * waveform.bandwidth) * draw.log(1e-3, samples / 10)


def exact_points(raw: Any, scene: Any, waveform: Any, allowed: float, window: tuple[float, float] | None) -> None:
    """Compare echoes of points, without weights of antennas, with the sum over the points."""
    lit = np.isin(raw.polarization, ("HH", "VV"))
    expect(not np.asarray(raw.samples)[~lit].any(), "points have echoes in HV or VH")
    wanted, power = np.zeros(raw.samples.shape, np.complex128), 0.0
    for p in np.flatnonzero(lit):
        f = raw.frequency[p] + raw.frequency_step[p] * np.arange(raw.n_samples)
        pulse = waveform.pulse_spectrum(f)
        spectrum = abs(pulse) ** 2 if raw.compressed else pulse
        off = half_path(raw.tx[p], raw.rx[p], scene.positions, raw.reference_range[p])
        seen = np.ones(len(off), bool)
        if window is not None:
            clear = 1e-6 * (abs(off).max() + np.linalg.norm(raw.tx[p] - scene.positions[0]) * 1e-6)
            if any((abs(off - end) < clear).any() for end in window):
                return  # rounding may put a point on either side
            seen = (off >= window[0]) & (off <= window[1])
        a = scene.amplitudes * seen
        wanted[p] = spectrum * exact_echo(scene.positions, a, f, raw.tx[p], raw.rx[p], raw.reference_range[p])
        power += float((abs(spectrum) ** 2).sum() * (abs(a) ** 2).sum())
    near(raw.samples, wanted, allowed, max(float(np.linalg.norm(wanted)), np.sqrt(power)), "samples")


def points(draw: Draw) -> None:
    """Points against the echo equation; weights of antennas by check=True."""
    waveform, track, center = setting(draw)
    scene, options = inputs.points(draw, center, size_of(draw, waveform)), options_of(draw, waveform, track, center)
    track = aimed(track, center, options)
    weighted = "antenna" in options or "radar" in options
    raw = sarcl.echo(scene, waveform, track, check=weighted, **options)
    finite(raw.samples, "samples")
    within_report(raw, options["tolerance"])
    if weighted:
        return None
    if raw.samples.size * len(scene.positions) > MOST:
        raw = sarcl.echo(scene, waveform, track, check=True, **options)
        return within_report(raw, options["tolerance"])
    return exact_points(raw, scene, waveform, options["tolerance"], options.get("range_window"))


def facets(draw: Draw) -> None:
    """Facets, by check=True: samples recomputed with the reference."""
    waveform, track, center = setting(draw, 6)
    wavelength = C / waveform.center
    scene = inputs.facets(draw, wavelength * draw.log(0.01, 30)).moved(center)
    if draw.chance(0.2):
        scene = scene + inputs.points(draw, center, wavelength)
    options = {**options_of(draw, waveform, track, center), "tolerance": inputs.tolerance(draw, 1e-4)}
    track = aimed(track, center, options)
    extra: dict[str, Any] = {"max_edge": draw.pick("auto", "auto", wavelength, None)} if draw.chance(0.3) else {}
    if draw.chance(0.3):
        extra["shadows"] = False
    raw = sarcl.echo(scene, waveform, track, check=True, seed=draw.whole(1, 99), **options, **extra)
    finite(raw.samples, "samples")
    within_report(raw, options["tolerance"])


def channels(draw: Draw) -> None:
    """Channels of arrays: those kept apart are echoes of their elements, and summed ones are checked."""
    waveform, track, center = setting(draw, 6)
    wavelength = C / waveform.center
    array = inputs.array(draw, wavelength, waveform.bandwidth)
    scene = inputs.points(draw, center, size_of(draw, waveform, 300))
    how = draw.pick(
        {}, {"channels": "separated"}, {"channels": "separated", "receive": "own"}, {"receive": "all"},
        {"channels": "separated", "receive": "all"},
    )  # fmt: skip
    allowed = inputs.tolerance(draw, 1e-5)
    raw = sarcl.echo(
        scene, waveform, track, array=array, tolerance=allowed, check=True, device=inputs.device(draw), **how
    )
    finite(raw.samples, "samples")
    within_report(raw, allowed)
    if how.get("receive") != "own" or array.n == 1:
        return
    p = draw.whole(1, raw.n_rows) - 1
    f = raw.frequency[p] + raw.frequency_step[p] * np.arange(raw.n_samples)
    element = int(raw.tx_channel[p])
    offset = array.offsets_at(p // array.n)[element]
    spectrum = array.weights[element] * waveform.matched_spectrum(f - offset)
    wanted = spectrum * exact_echo(scene.positions, scene.amplitudes, f, raw.tx[p], raw.rx[p], raw.reference_range[p])
    power = np.sqrt((abs(scene.amplitudes) ** 2).sum()) * np.linalg.norm(spectrum)
    whole = float(np.linalg.norm(np.asarray(raw.samples)))  # errors are relative to all rows
    near(np.asarray(raw.samples[p]), wanted, allowed, max(float(np.linalg.norm(wanted)), power, whole), "channel")


def mapped(draw: Draw) -> None:
    """A point at the centre has no phase left after its delays are removed."""
    center, track = inputs.origin(draw), inputs.track(draw, draw.whole(1, 5), inputs.distance(draw))
    track = replace(track, positions=track.positions + center)
    carrier, n = draw.log(1e8, 1e12), draw.whole(2, 9)
    step = carrier * draw.log(1e-5, 1e-2)
    waveform = sarcl.Waveform.tone(center=carrier, duration=draw.log(0.5, 10) / step)
    array = sarcl.AntennaArray.linear(
        n, spacing=C / carrier * draw.uniform(-2, 2), frequency_step=step, axis=draw.normal(3)
    )
    raw = sarcl.echo(
        sarcl.Scene.points([center]), waveform, track, array=array, reference=center, check=False,
        device=inputs.device(draw), tolerance=1e-4,
    )  # fmt: skip
    mapping = draw.pick("corrected", "apparent", "channels")
    made = sarcl.map_aperture(raw, mapping, center=center, quadratic=draw.chance(0.8))
    finite(made.samples, "samples")
    finite(made.tx, "tx")
    expect(made.n_rows == (raw.n_rows * array.n if mapping == "channels" else raw.n_rows), f"{made.n_rows} rows")


def spectral(draw: Draw) -> None:
    """A straight track, evenly sampled; checked pulses, and the samples of `echo`."""
    n, away = draw.whole(2, 64), draw.log(100, 1e5)
    center = draw.log(1e8, 3e10)
    wavelength, bandwidth = C / center, center * draw.log(1e-3, 0.3)
    speed, step = draw.log(1, 1e4), wavelength * draw.log(0.01, 0.6)
    track = sarcl.Trajectory.line(
        start=(-0.7 * away, -step * n / 2, 0.7 * away), velocity=(0, speed, 0), prf=speed / step, n_pulses=n
    )
    chirp = sarcl.Waveform.chirp(center=center, bandwidth=bandwidth, duration=draw.log(10, 1e3) / bandwidth)
    size = min(C / (2 * bandwidth) * draw.log(0.1, 30), 3e3 * wavelength)  # transforms of larger maps take a minute
    scene = inputs.points(draw, np.zeros(3), size) if draw.chance(0.7) else inputs.facets(draw, wavelength)
    options: dict[str, Any] = {"tolerance": inputs.tolerance(draw, 1e-5), "device": inputs.device(draw)}
    if draw.chance(0.3):
        track = sarcl.pointing.stripmap(track, np.pi / 4, squint=draw.uniform(-0.3, 0.3))
        options["antenna"] = sarcl.Antenna.gaussian(width=(draw.log(0.01, 0.5), 0.5))
    if draw.chance(0.2):
        options["polarization"] = draw.pick("VV", "all")
    raw = sarcl.spectral_echo(scene, chirp, track, check=True, **options)
    finite(raw.samples, "samples")
    within_report(raw, options["tolerance"])
    points_alone = len(scene.triangles) == 0 and "antenna" not in options
    if points_alone and raw.samples.size * len(scene.positions) <= MOST:
        exact_points(raw, scene, chirp, options["tolerance"], None)


def planned(draw: Draw) -> None:
    """A forecast is refused where echoes are, with the same best tolerance."""
    waveform, track, center = setting(draw)
    facets = draw.chance(0.3)
    scene = inputs.facets(draw, C / waveform.center).moved(center) if facets else inputs.points(
        draw, center, size_of(draw, waveform)
    )  # fmt: skip
    options = options_of(draw, waveform, track, center)
    track = aimed(track, center, options)
    said = made = None
    try:
        forecast = sarcl.plan(sarcl.echo, scene, waveform, track, **options)
        finite([forecast.seconds, forecast.bytes], "forecast")
        str(forecast)
    except sarcl.ToleranceUnreachable as exc:
        said = exc
    try:
        sarcl.echo(scene, waveform, track, check=False, **options)
    except sarcl.ToleranceUnreachable as exc:
        made = exc
    expect((said is None) == (made is None), f"plan: {said}; echo: {made}")
    if said is not None:
        raise said


def compress(draw: Draw) -> None:
    n, n_samples = draw.whole(1, 10), draw.whole(1, 100)
    raw = inputs.history(draw, n, n_samples, np.zeros(3))
    pulse = inputs.waveform(draw)
    raw = replace(raw, compressed=False, waveform=pulse if draw.chance(0.5) else None)
    found = sarcl.compress(raw, pulse)
    for p in range(n):
        f = raw.frequency[p] + raw.frequency_step[p] * np.arange(n_samples)
        wanted = matched_filter(np.asarray(raw.samples[p : p + 1]), pulse.pulse_spectrum(f))[0]
        near(np.asarray(found.samples[p]), wanted, 1e-6, what="compressed row")


def from_time(draw: Draw) -> None:
    """Every sample of a record of the whole band comes back at its delay."""
    n, m = draw.whole(1, 6), draw.whole(2, 60)
    carrier = draw.log(1e6, 1e13)
    rate = carrier * draw.log(1e-5, 1.9)
    start, y = draw.log(1e-9, 0.2) * (1 + draw.random.random(n)), draw.noise(n, m)
    tx = inputs.positions(draw, n, inputs.distance(draw))
    kind = draw.pick("compressed", "compressed", "chirped", "dechirped")
    if kind == "dechirped":
        real = draw.chance(0.5)
        raw = sarcl.PhaseHistory.from_time(
            y.real if real else y, rate=rate, start=start, carrier=carrier, tx=tx, kind=kind,
            sweep_rate=rate * carrier * draw.log(1e-9, 0.1) / m * draw.pick(1, -1),
            beat=None if real else draw.pick("positive", "negative"),
            reference_range=draw.pick(0.0, draw.log(1, 1e6)), scene_range=draw.pick(None, draw.log(1, 1e6)),
        )  # fmt: skip
        return finite(raw.samples, "samples")
    if kind == "chirped":
        bandwidth = min(rate, carrier) * draw.log(1e-2, 1)
        chirp = sarcl.Waveform.chirp(center=carrier, bandwidth=bandwidth, duration=draw.log(1, 300) / bandwidth)
        raw = sarcl.PhaseHistory.from_time(
            y, rate=rate, start=start, tx=tx, kind=kind, waveform=chirp, pulse_time=draw.pick("start", "middle")
        )
        return finite(sarcl.compress(raw).samples, "samples")
    raw = sarcl.PhaseHistory.from_time(y, rate=rate, start=start, carrier=carrier, tx=tx)
    for p in range(n):
        t = np.longdouble(start[p]) + np.arange(m) / np.longdouble(rate)
        late = t - 2 * np.longdouble(raw.reference_range[p]) / np.longdouble(C)
        f = np.longdouble(raw.frequency[p]) + np.longdouble(raw.frequency_step[p]) * np.arange(raw.n_samples)
        cycles = np.mod(np.outer(late, f), 1).astype(float)
        made = np.exp(2j * np.pi * cycles) @ np.asarray(raw.samples[p]) / m
        wanted = y[p] * np.exp(2j * np.pi * np.mod(np.longdouble(carrier) * t, 1).astype(float))
        # the positions of a float64 carrier and reference range: their rounding is a phase
        rounding = 2e-16 * carrier * float(abs(late).max()) * 10 + 1e-9
        near(made, wanted, 1e-5 + 7 * rounding, what="record")


def kept(draw: Draw) -> None:
    """Files, parts, noise and sums of echoes keep what they should."""
    n = draw.whole(1, 20)
    even = {"time": np.arange(n) * draw.log(1e-6, 10)} if draw.chance(0.5) else {}
    raw = inputs.history(draw, n, draw.whole(1, 40), inputs.origin(draw), **even)
    whole = np.asarray(raw.samples)
    cut = draw.whole(1, raw.n_rows)
    if cut < raw.n_rows:
        again = sarcl.concatenate([raw[:cut], raw[cut:]])
        expect(np.array_equal(np.asarray(again.samples[:]), whole), "parts together")
    with tempfile.TemporaryDirectory() as folder:
        raw.save(Path(folder) / "a.h5")
        found = sarcl.read(Path(folder) / "a.h5")
        expect(np.array_equal(np.asarray(found.samples[:]), whole.astype(found.samples.dtype)), "samples of a file")
        for name in ("tx", "rx", "frequency", "frequency_step", "reference_range", "time", "weight"):
            expect(np.array_equal(getattr(found, name), getattr(raw, name)), f"{name} of a file")
    noisy = sarcl.add_noise(raw, variance=draw.log(1e-20, 1e20), seed=draw.whole(1, 9))
    a, b = sorted(draw.random.integers(0, raw.n_rows + 1, 2))
    if a < b:
        expect(np.array_equal(noisy.samples[int(a) : int(b)], noisy.samples[:][a:b]), "noise depends on what is read")
    finite(raw.time_signal(draw.whole(1, 4))[1], "time signal")
    if raw.time is not None and raw.n_rows > 1:
        finite(sarcl.doppler_centroid(raw), "centroid")


def moving(draw: Draw) -> None:
    """Tracks in motion: none changes nothing, any is finite, and echoes of parts add up."""
    away = inputs.distance(draw)
    track = inputs.track(draw, draw.whole(1, 20), away, timed=draw.chance(0.8))
    if draw.chance(0.8):
        track = sarcl.pointing.spotlight(track, (0, 0, 0))
    motion = sarcl.motion
    still = motion.sinusoidal(track, amplitude=(0, 0, 0), frequency=draw.log(1e-3, 1e3))
    near(still.positions, track.positions, 1e-15, what="track at rest")
    made = motion.perturbed(
        track, rms=away * draw.log(1e-9, 1e-3), correlation_time=draw.log(1e-3, 1e3), seed=draw.whole(1, 99),
        attitude_rms=draw.pick(0.0, 1e-3), frame=draw.pick("scene", "track"),
    )  # fmt: skip
    finite(made.positions, "positions")
    turned = motion.relative(track, velocity=draw.normal(3) * 10, rotation=draw.normal(3), epoch=draw.normal())
    finite(turned.positions, "positions")
    waveform = sarcl.Waveform.chirp(center=draw.log(1e6, 1e12), bandwidth=5e5, duration=draw.log(1e-6, 1e-3))
    points = draw.normal(3, 3) * away * 1e-3
    found = sarcl.stop_and_go.stop_and_go_error(track, points, waveform)
    finite(found.flight, "flight")


VERBS = {
    "echo, points": (120, points), "echo, facets": (40, facets), "echo, arrays": (60, channels),
    "map_aperture": (25, mapped), "spectral_echo": (30, spectral), "plan_echo": (25, planned),
    "compress": (25, compress), "from_time": (40, from_time), "kept": (30, kept), "motion": (25, moving),
}  # fmt: skip
