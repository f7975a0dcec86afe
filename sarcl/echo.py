"""Echoes of points and facets, pulse by pulse, to a stated tolerance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import cl, geodesy, planning, scatterers
from .check import SPEED_OF_LIGHT, array, choice, count, direction, finite, instance, number, sealed
from .check import tolerance as allowed_error
from .echo_error import measure_error
from .facet_plan import FacetPlan, crowding, cut_facets, plan_facets
from .facet_spread import POLARIZATIONS, FacetSpreader
from .geometry import Antennas
from .material import COHERENT
from .phase_history import PhaseHistory
from .planning import Clock
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
    polarization: str | Sequence[str] = "HH",
    vertical: Any = None,
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

    scene         points (|amplitude|^2 = RCS, m^2) and facets: physical optics with the materials' Fresnel
                  coefficients, the exact phase of the wave over every facet, single scattering (docs/facets.md)
    track         transmitter; receiver  a track of as many pulses, default the transmitter's
    polarization  "HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": a row a pulse for
                  each, pulse by pulse. Points send back what they are sent: nothing in HV and VH
    vertical      (3,), which H lies across and V in a plane with; default z, or in Earth-centred coordinates the
                  ellipsoid's normal at the scene's centre
    range_window  (near, far) m about the reference, default the smallest that holds the scene plus 10 %;
                  scatterers outside it are gated out, row by row
    reference     point of zero phase, m (3,), default the centre of the scene's box
    shadows       True: of every facet only the share counts that both antennas see, in blocks of pulses
                  (docs/shadows.md; points are always seen)
    seed          of the facets' random heights (scene.roughness); the same for any device and block size
    skip          True, False or a set of reasons: "zero reflectivity", "facing away", "range window"
    compressed    False keeps the pulse's own spectrum (see `sarcl.compress`)
    max_edge      facets are cut until no edge is longer, m; "auto": as the tolerance needs, rough ones to half a
                  resolution cell too; None: left as they are
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
    polarizations = _polarizations(polarization)
    tolerance = allowed_error(tolerance)
    skips = planning.skips(skip, SKIPS)
    rx = _receiver(track, receiver)
    tx = track.positions
    point = scene.center if reference is None else array("reference", reference, np.float64, (3,))
    reference_range = _half_path(tx, rx, point)
    upright = _vertical(vertical, scene.center)
    scene = scene.realized(seed)  # before the window: it moves the corners of rough terrain
    near, far = _window(scene, waveform, tx, rx, reference_range, range_window)
    frequency, step, n_samples = _sampling(waveform, near, far, compressed)
    try:
        samples = np.zeros((len(tx), len(polarizations), n_samples), np.complex64)
    except (MemoryError, ValueError):
        raise MemoryError(
            f"echoes of {len(tx)} pulses x {len(polarizations)} polarisations x {n_samples} samples need "
            f"{cl.size_text(8.0 * n_samples * len(tx) * len(polarizations))}, more "
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
    # points and facets err independently: each gets its share, so that the sum keeps the tolerance
    share = tolerance / np.sqrt(2 if len(scene.positions) and len(scene.triangles) else 1)
    frequencies = frequency + step * np.arange(n_samples)
    points, skipped = scatterers.points_of(scene, skips, len(tx))
    facets, facet_plan, crowd = None, None, 1.0
    if len(scene.triangles):
        facet_plan, pieces, crowd = _cut(scene, waveform, antennas, len(polarizations), max_edge, share)
        if progress:
            progress("scene", 1, 3)
        facets, left_out = scatterers.facets_of(
            pieces, waveform, antennas, shadows=shadows, seed=seed, skips=skips, max_bytes=budget / 4, device=opened,
            tell=(lambda n: None) if progress is None else lambda n: progress("scene", n, 3),
        )  # fmt: skip
        skipped = {why: skipped.get(why, 0) + n for why, n in left_out.items()}
    same = [i for i, name in enumerate(polarizations) if name[0] == name[1]]
    if facets is None and points is not None and not same:
        raise ValueError(
            f"polarization is {polarization!r}, in which points send back nothing: ask for 'HH' or 'VV', or give facets"
        )
    if points is None and facets is None:
        raise ValueError(f"nothing is left to reflect: {_reasons(skipped)}; move the track or the scene")
    if points is not None and points.largest() > LARGEST:
        text = f"amplitudes reach {points.largest():g}; echoes in complex64 hold up to {LARGEST:g}"
        raise ValueError(text + ": scale them down")
    clock.lap("scene")

    common = (opened, antennas, waveform.bandwidth)
    total, done, gated, behind = sum(len(p) for p in (points, facets) if p is not None) * len(tx), 0, 0, 0

    def tell(n: int) -> None:
        if progress:
            progress("echo", done + n, total)

    tell(0)
    plans: list[tuple[float, dict[str, Any]]] = []
    if points is not None:
        if same:
            spreader = Spreader(*common, n_samples, share, budget, "range window" in skips)
            plan, gated = spreader.add(points, samples[:, same[0]], clock, tell)
            samples[:, same[1:]] = samples[:, same[:1]]
            plans.append((plan.predicted_error, plan.describe("spread")))
        done += len(points) * len(tx)
    if facets is not None:
        assert facet_plan is not None
        facet_spreader = FacetSpreader(
            *common,
            frequencies,
            share / crowd,
            budget,
            "range window" in skips,
            polarizations,
            facet_plan,
            upright,
        )
        plan, outside, behind = facet_spreader.add(facets, samples, clock, tell)
        gated += outside
        how = plan.describe("spread") | facet_plan.describe()
        plans.append((crowd * (plan.predicted_error + facet_plan.predicted_error), how))
    if gated == total:
        raise ValueError(
            f"every scatterer is outside the range window of {near:g} to {far:g} m about the reference; "
            "widen range_window or move reference"
        )
    if gated + behind == total:
        raise ValueError("every facet in the range window faces away from an antenna; move the track or turn the scene")
    pulse = waveform.pulse_spectrum(frequencies)
    spectrum = np.abs(pulse) ** 2 if compressed else pulse
    samples *= spectrum.astype(np.complex64)
    clock.lap("spectra")
    measured = None
    exact_seconds = 256 * (0 if points is None else len(points)) * 6e-8 + (0 if facets is None else len(facets)) * 1e-4
    if check or (check is None and exact_seconds < 0.02 * clock.seconds.get("echo", 0.0)):
        measured = measure_error(points, facets, antennas, frequencies, spectrum, samples, polarizations, upright)
        clock.lap("check")
    n = len(polarizations)

    def every(values: Any) -> Any:
        return values if n == 1 or values is None else np.repeat(values, n, axis=0)

    velocities = [t.velocities for t in (track, track if receiver is None else receiver)]
    skipped["facing away"] = skipped.get("facing away", 0) + behind
    return PhaseHistory(
        sealed(samples.reshape(-1, n_samples)),
        frequency=frequency,
        frequency_step=step,
        tx=every(tx),
        rx=None if receiver is None else every(rx),
        reference_range=every(reference_range),
        time=every(track.times),
        polarization=np.tile(polarizations, len(tx)),
        tx_velocity=every(velocities[0]),
        rx_velocity=every(velocities[1]),
        waveform=waveform,
        compressed=compressed,
        report=Report(
            plan={"model": "stop and go, single scattering", **max(plans, key=lambda p: p[0])[1]} if plans else {},
            tolerance=tolerance,
            predicted_error=float(np.sqrt(sum(error**2 for error, _ in plans))),
            measured_error=measured,
            contributions_done=total - gated - behind,
            contributions_skipped={**skipped, "range window": gated},
            seconds=clock.seconds,
            device=opened.info.name,
            seed=seed,
        ),
    )


def _polarizations(asked: Any) -> tuple[str, ...]:
    """Names in the order of a pulse's rows; ValueError for unknown, repeated or none."""
    if isinstance(asked, str):
        asked = POLARIZATIONS if asked == "all" else (asked,)
    names = tuple(asked) if isinstance(asked, Sequence) else ()
    if not names or len(set(names)) < len(names):
        raise ValueError(f"polarization is {asked!r}; give at least one, and each once")
    for name in names:
        choice("polarization", name, POLARIZATIONS)
    return names


def _vertical(asked: Any, center: np.ndarray) -> np.ndarray:
    """Unit vector (3,): as asked, the ellipsoid's normal at an Earth-centred `center`, m (3,), or z."""
    if asked is not None:
        return direction("vertical", asked)
    normal = geodesy.vertical_at(center)
    return np.array([0.0, 0.0, 1.0]) if normal is None else normal


def _cut(
    scene: Scene, waveform: Waveform, antennas: Antennas, channels: int, max_edge: float | str | None, share: float,
) -> tuple[FacetPlan, Scene, float]:  # fmt: skip
    """The plan of the facets, the facets cut as it says, and what `crowding` says of it."""
    scene = replace(scene, positions=np.zeros((0, 3)), amplitudes=np.zeros(0, np.complex128))
    finest = np.inf
    if max_edge == "auto" and (scene.roughness.any() or any(m.diagram not in COHERENT for m in scene.materials)):
        finest = scatterers.resolution_edge(waveform, antennas, scene)
    elif isinstance(max_edge, (int, float)):
        finest = number("max_edge", max_edge, above=0)
    elif max_edge not in ("auto", None):
        raise ValueError(f"max_edge is {max_edge!r}; give a length in m, 'auto', or None")
    wanted, crowd = share, 1.0
    for _ in range(6):
        plan = plan_facets(
            wanted / crowd, scene, antennas, waveform.center, waveform.bandwidth, channels, finest,
            cut=max_edge is not None,
        )  # fmt: skip
        found = 1.0 if max_edge is None else crowding(scene, plan.max_edge, antennas, plan.nodes)
        if found <= crowd:
            break
        crowd = 1.1 * found
    else:
        raise ValueError(
            f"tolerance {share:.1e} cannot be met with these facets: cut finely enough, their edges' echoes cancel to "
            f"less than a {crowd:.0f}th; ask for a looser one, or let fewer facets make up a plane"
        )
    made = scene if max_edge is None else cut_facets(scene, plan, finest)
    return replace(plan, n_facets=len(made.triangles)), made, crowd


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
