"""Options that the verbs which make images share: their records contain these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import arguments, wgs84
from ..base.errors import confirm_tolerance
from ..base.options import option
from ..base.stage_timer import Clock
from ..base.types import PathLike
from ..io import formats, output_paths
from ..model import store
from ..model.image import Image
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics.run_options import RunOptions
from ..numerics.windows import Window, in_words
from ..opencl.device import Device
from ..opencl.memory_budget import budget

EXACT_PAIR = 3e-8  # s, of the exact sum, per sample and pixel
NORM_BLOCK = 2**20  # pixels of an image whose squares are added up at once
CHEAP_CHECK = 0.02  # share of the time of the image: a check that costs less is made by default


@dataclass(frozen=True, eq=False, kw_only=True)
class FocusOptions(RunOptions):
    """Options of every verb that makes an image."""

    window: Window | None = option(
        None,
        'None, "hamming", ("taylor", sidelobe_db, nbar), another name of scipy.signal.windows, such as "hann" or '
        '("kaiser", 8.6): over samples and over rows; or a pair (range, cross-range) of these, of None, or of arrays '
        "with a weight per sample and per row of a channel. In cross-range with a beam that leaves pixels out: over "
        "the aperture of each pixel, the rows that see it",
    )
    weights: ArrayLike | None = option(None, "one per row (n_rows,), multiplied with window and raw.weight")
    out: PathLike | None = option(
        None, 'None, or a path ending in ".h5": the image is written there when it is finished', in_files=False
    )

    def budget(self, device: Device) -> float:
        """Bytes that blocks may take on a device."""
        return min(budget(device, self.max_bytes), device.info.memory)

    def measured(self, pairs: float, seconds: float, clock: Clock, error: Callable[[], float]) -> float | None:
        """The error of some pixels, where the exact sum of so many pairs of sample and pixel is asked for, or cheap
        beside the seconds of the image; else None."""
        if not (pairs * EXACT_PAIR < CHEAP_CHECK * seconds if self.check is None else self.check):
            return None
        value = error()
        clock.lap("check")
        return value

    def shares_of(self, stage: str) -> Callable[[float], None]:
        """The function that reports the share of a stage that is done."""

        def on_progress(share: float) -> None:
            if self.progress:
                self.progress(stage, round(1000 * share), 1000)

        return on_progress


def relative_error(
    data: Any, index: tuple[np.ndarray, ...], exact: np.ndarray, random: float, tolerance: float
) -> float:  # data: an array, or a dataset of a file
    """Error of an image's pixels at `index` against exact ones, relative to the larger of their norm and `random`, that
    of random phases. Pixels of an infinite sum do not count.

    Where that exceeds the tolerance, the norm is that of so many pixels in the mean over the image: a few bright
    pixels may hold its energy, and seldom are among those chosen.
    """
    pixels = data[index] if isinstance(data, np.ndarray) else np.array([data[i] for i in zip(*index, strict=True)])
    clear = np.isfinite(exact)
    wrong, norm = float(np.linalg.norm((pixels - exact)[clear])), max(float(np.linalg.norm(exact[clear])), random)
    if wrong > tolerance * norm:
        norm = max(norm, norm_of(data) * np.sqrt(clear.sum() / np.prod(data.shape)))
    return wrong / norm if wrong else 0.0


def norm_of(data: Any) -> float:
    """Euclidean norm of an image's finite pixels, by blocks in float64: squares of float32 overflow from 2e19 on, and
    vanish below 1e-23."""
    n = data.shape[0]
    step = max(1, NORM_BLOCK * n // max(1, np.prod(data.shape)))
    blocks = (np.asarray(data[i : i + step]).astype(np.complex128) for i in range(0, n, step))
    return float(np.sqrt(sum(np.linalg.norm(block[np.isfinite(block)]) ** 2 for block in blocks)))


def check_output(out: PathLike | None) -> None:
    """ValueError or OSError where no image can be written at `out`."""
    if out is not None:
        formats.writer_functions(arguments.path("out", out), "image")
        output_paths.check_writable(out)


def finished(image: Image, out: PathLike | None, instead: str) -> Image:
    """The image, written to `out` and read from there where that is a path. ToleranceMissed, with that image, where its
    check measured more than the tolerance; instead  what to do then."""
    if out is not None:
        image.save(out)
        stored = store.read(out)
        assert isinstance(stored, Image)
        image = stored
    confirm_tolerance(image=image, instead=instead)
    return image


@dataclass(frozen=True, eq=False, kw_only=True)
class GridOptions(FocusOptions):
    """Options of every verb that makes an image on a grid."""

    sum_polarizations: bool = option(
        False, "True: rows of several polarisations are summed coherently; False: they are refused"
    )


def collection(raw: PhaseHistory, grid: ImageGrid, window: Window | None) -> dict[str, Any]:
    """Fields of the Image that echoes are focused to, but data, grid, gain, frequency and report."""
    middle = raw.n_rows // 2
    half = raw.frequency_step / 2
    kinds = [] if raw.polarization is None else sorted(set(raw.polarization.tolist()))
    speeds = {n: getattr(raw, n) for n in ("tx_velocity", "rx_velocity")}
    if raw.is_monostatic and speeds["rx_velocity"] is None:
        speeds["rx_velocity"] = speeds["tx_velocity"]
    return {
        "tx": raw.tx[middle],
        "rx": raw.rx[middle],
        **{name: None if speed is None else speed[middle] for name, speed in speeds.items()},
        "time": None if raw.time is None else (raw.time.min(), raw.time.max()),
        "band": ((raw.frequency - half).min(), (raw.frequency + (raw.n_samples - 1) * raw.frequency_step + half).max()),
        "window": in_words(window),
        "polarization": "+".join(kinds) or None,
        "frame": "local" if wgs84.vertical_at(grid.bounds.mean(axis=0)) is None else "earth-fixed",
    }
