"""Echoes of points and facets, pulse by pulse, to a stated tolerance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from . import cl, planning, scatterers
from .check import SPEED_OF_LIGHT, array, choice, count, finite, instance, sealed
from .check import tolerance as allowed_error
from .geometry import Antennas
from .phase_history import PhaseHistory
from .planning import Clock, Plan
from .report import Report
from .scene import Scene
from .spread import Spreader
from .trajectory import Trajectory
from .waveform import Waveform

SKIPS = ("zero reflectivity", "facing away", "range window")
LEAST_SAMPLES = 64  # of the default range window: a lone point still gets a profile to look at
LARGEST = 1e30  # amplitude whose sums and spectra still fit in complex64
Progress = Callable[[str, int, int], None]


def echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    receiver: Trajectory | None = None,
    polarization: str = "HH",
    range_window: Any = None,
    reference: Any = None,
    shadows: bool = True,
    seed: int = 0,
    skip: Any = True,
    compressed: bool = True,
    max_edge: float | str | None = "auto",
    max_bytes: float | None = None,
    tolerance: float = 1e-3,
    check: bool | None = None,
    device: Any = None,
    progress: Progress | None = None,
) -> PhaseHistory:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed.

    scene         points (|amplitude|^2 = RCS, m^2) and facets: a = 2 sqrt(pi)/lambda reflectivity area cos(incidence)
    track         transmitter; receiver  a track of as many pulses, default the transmitter's
    polarization  "HH" or "VV" (alike: this facet model has no cross-polarised return)
    range_window  (near, far) m about the reference, default the smallest that holds the scene plus 10 %;
                  scatterers outside it are gated out, row by row
    reference     point of zero phase, m (3,), default the centre of the scene's box
    shadows       True: facets whose centroid is hidden at mid-aperture are dark (points are always seen)
    seed          of the facets' random heights (scene.roughness); the same for any device and block size
    skip          True, False or a set of reasons: "zero reflectivity", "facing away", "range window"
    compressed    False keeps the pulse's own spectrum (see `sarcl.compress`)
    max_edge      facets are cut until no edge is longer, m; "auto" half a resolution cell, None: left as they are
    max_bytes     memory for blocks on the device, default 1 GiB on CPUs, half the memory of a GPU
    tolerance     L2 error of the samples, relative to the larger of their norm and the norm they would have if
                  scatterers added with random phases
    check         recompute 256 random samples exactly; None: where that costs less than 2 %
    progress      called as progress(stage, done, total)

    Stop and go; spreading loss and gains are left out. Returns a PhaseHistory. ValueError, MemoryError,
    sarcl.NoDeviceError say what does not fit. Source: DESIGN.md, echo equation.
    """
    clock = Clock()
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    seed = count("seed", seed, 0)
    opened = cl.open_device(device)
    choice("polarization", polarization, ("HH", "VV"))
    tolerance = allowed_error(tolerance)
    skips = planning.skips(skip, SKIPS)
    rx = _receiver(track, receiver)
    tx = track.positions
    point = scene.center if reference is None else array("reference", reference, np.float64, (3,))
    reference_range = _half_path(tx, rx, point)
    near, far = _window(scene, waveform, tx, rx, reference_range, range_window)
    frequency, step, n_samples = _sampling(waveform, near, far, compressed)
    try:
        samples = np.zeros((len(tx), n_samples), np.complex64)
    except (MemoryError, ValueError):
        raise MemoryError(
            f"echoes of {len(tx)} pulses x {n_samples} samples need {cl.size_text(8.0 * n_samples * len(tx))}, more "
            f"than there is; narrow range_window (now {near:g} to {far:g} m) or split the track"
        ) from None
    antennas = Antennas(
        tx=tx,
        rx=None if receiver is None else rx,
        reference_range=reference_range,
        frequency=np.full(len(tx), frequency + n_samples // 2 * step),
        frequency_step=np.full(len(tx), step),
        near=np.full(len(tx), near),
        far=np.full(len(tx), far),
    )
    budget = planning.budget(opened, max_bytes)
    if progress:
        progress("scene", 0, 3)
    parts, skipped = scatterers.prepare(
        scene,
        waveform,
        antennas,
        shadows=shadows,
        seed=seed,
        skips=skips,
        max_edge=max_edge,
        device=opened,
        tell=None if progress is None else lambda n: progress("scene", n, 3),
    )
    if not parts:
        raise ValueError(f"nothing is left to reflect: {_reasons(skipped)}; move the track or the scene")
    largest = max(part.largest() for part in parts)
    if largest > LARGEST:
        raise ValueError(f"amplitudes reach {largest:g}; echoes in complex64 hold up to {LARGEST:g}: scale them down")
    clock.lap("scene")

    # points and facets err independently: each gets its share, so that the sum keeps the tolerance
    share = tolerance / np.sqrt(len(parts))
    spreader = Spreader(opened, antennas, waveform.bandwidth, n_samples, share, budget, "range window" in skips)
    total, done, gated = sum(len(p) for p in parts) * len(tx), 0, 0
    if progress:
        progress("echo", 0, total)
    plans: list[Plan] = []
    for part in parts:
        tell = None if progress is None else lambda n, before=done: progress("echo", before + n, total)
        plan, missed = spreader.add(part, samples, clock, tell)
        plans.append(plan)
        done += len(part) * len(tx)
        gated += missed
    if gated == total:
        raise ValueError(
            f"every scatterer is outside the range window of {near:g} to {far:g} m about the reference; "
            "widen range_window or move reference"
        )
    frequencies = frequency + step * np.arange(n_samples)
    pulse = waveform.pulse_spectrum(frequencies)
    spectrum = np.abs(pulse) ** 2 if compressed else pulse
    samples *= spectrum.astype(np.complex64)
    clock.lap("spectra")
    measured = None
    exact_seconds = 256 * sum(len(p) for p in parts) * 6e-8
    if check or (check is None and exact_seconds < 0.02 * clock.seconds.get("echo", 0.0)):
        measured = _measure_error(parts, antennas, frequencies, spectrum, samples)
        clock.lap("check")
    return PhaseHistory(
        sealed(samples),
        frequency=frequency,
        frequency_step=step,
        tx=tx,
        rx=None if receiver is None else rx,
        reference_range=reference_range,
        time=track.times,
        polarization=np.full(len(tx), polarization),
        tx_velocity=track.velocities,
        rx_velocity=track.velocities if receiver is None else receiver.velocities,
        waveform=waveform,
        compressed=compressed,
        report=Report(
            plan={"model": "stop and go", **max(plans, key=lambda p: p.predicted_error).describe("spread")},
            tolerance=tolerance,
            predicted_error=float(np.sqrt(sum(p.predicted_error**2 for p in plans))),
            measured_error=measured,
            contributions_done=total - gated,
            contributions_skipped={**skipped, "range window": gated},
            seconds=clock.seconds,
            device=opened.info.name,
            seed=seed,
        ),
    )


def _receiver(track: Trajectory, receiver: Trajectory | None) -> np.ndarray:
    """Receiver positions (n_pulses, 3)."""
    if receiver is None:
        return track.positions
    instance("receiver", receiver, Trajectory)
    if len(receiver) != len(track):
        raise ValueError(f"receiver has {len(receiver)} positions but track has {len(track)}; give one per pulse")
    return receiver.positions


def _half_path(tx: np.ndarray, rx: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Half the two-way path from antennas (n, 3) to points (..., 3), m."""
    return (np.linalg.norm(tx - point, axis=-1) + np.linalg.norm(rx - point, axis=-1)) / 2


def _window(
    scene: Scene, waveform: Waveform, tx: np.ndarray, rx: np.ndarray, reference_range: np.ndarray, asked: Any
) -> tuple[float, float]:
    """The range gate (near, far) about the reference, m: as asked, or what holds the scene's box plus 10 %."""
    if asked is not None:
        pair = np.asarray(asked, np.float64)
        if pair.shape != (2,):
            raise ValueError(f"range_window is {asked!r}; give (near, far) in metres about the reference")
        finite("range_window", pair)
        if not pair[0] < pair[1]:
            raise ValueError(f"range_window ({pair[0]:g}, {pair[1]:g}) is empty; near must be less than far")
        return float(pair[0]), float(pair[1])
    low, high = scene.bounds
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    # distance is convex: the farthest point of a box is a corner, the nearest is the antenna clipped to the box
    farthest = _half_path(tx, rx, corners).max(axis=0) - reference_range
    clipped = [np.linalg.norm(e - np.clip(e, low, high), axis=1) for e in (tx, rx)]
    nearest = (clipped[0] + clipped[1]) / 2 - reference_range
    least = LEAST_SAMPLES * SPEED_OF_LIGHT / (4 * waveform.bandwidth)
    half = max(1.1 * float(farthest.max()), -1.1 * float(nearest.min()), least)
    return -half, half


def _sampling(waveform: Waveform, near: float, far: float, compressed: bool) -> tuple[float, float, int]:
    """Frequency of sample 0, step, and number: f_n = fc - B/2 + (n + 1/2) df with n_samples df = B."""
    period = 4 * max(abs(near), abs(far)) / SPEED_OF_LIGHT
    if not compressed:
        period += waveform.duration  # so that pulses at the window's ends do not wrap
    n_samples = max(1, int(np.ceil(period * waveform.bandwidth * (1 - 1e-12))))
    step = waveform.bandwidth / n_samples
    return waveform.center - waveform.bandwidth / 2 + step / 2, step, n_samples


def _reasons(skipped: dict[str, int]) -> str:
    return ", ".join(why for why, n in skipped.items() if n) or "the scene is empty"


def _measure_error(
    parts: list[scatterers.Scatterers],
    antennas: Antennas,
    frequencies: np.ndarray,
    spectrum: np.ndarray,
    samples: np.ndarray,
) -> float:
    """Relative error of 256 random samples (16 random rows, 16 frequencies each) against the exact sum.

    Relative to the larger of their norm and the norm they would have if scatterers added with random phases.
    """
    from .reference.echo import echo as exact

    random = np.random.default_rng(0)
    rx = antennas.tx if antennas.rx is None else antennas.rx
    wrong = right = random_phases = 0.0
    for p in random.integers(0, len(samples), 16):
        n = random.integers(0, len(frequencies), 16)
        wanted, power = np.zeros(16, np.complex128), 0.0
        for part in parts:
            delta = _half_path(antennas.tx[p], rx[p], part.positions) - antennas.reference_range[p]
            seen = (delta >= antennas.near[p]) & (delta <= antennas.far[p])
            amplitudes = part.seen_by(antennas.tx[p], rx[p]) * seen
            power += float((np.abs(amplitudes) ** 2).sum())
            wanted += exact(
                part.positions, amplitudes, frequencies[n], antennas.tx[p], rx[p], antennas.reference_range[p]
            )
        wanted *= spectrum[n]
        wrong += float((np.abs(samples[p, n] - wanted) ** 2).sum())
        right += float((np.abs(wanted) ** 2).sum())
        random_phases += power * float((np.abs(spectrum[n]) ** 2).sum())
    return float(np.sqrt(wrong / max(right, random_phases))) if wrong else 0.0
