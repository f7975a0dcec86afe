"""Fields that an image keeps of the data it was made from, so that products can be written from it."""

from __future__ import annotations

from typing import Any

from ..base import wgs84
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics.windows import Window, in_words


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
