"""Records of tiles and pulses: what the points of a tile share for a pulse, computed by kernels/tile_constants.cl."""

from __future__ import annotations

from ..base import float_pairs
from ..opencl.device import Buffer, Device
from ..opencl.launch_numbers import launch_numbers
from .plan import Plan


class TileConstants:
    """The kernel for a plan, on a device: compiled for the few macros that change it, so that many plans share it.

    wrap    profiles repeat;  local   every tile has profiles of its own;  beam   pulses see only points in a cone
    nbytes  bytes of a record, of one tile and one pulse
    """

    def __init__(
        self, device: Device, plan: Plan, *, bistatic: bool, wrap: bool = False, local: bool = False, beam: bool = False
    ) -> None:
        self.device, self.wrap = device, plan.length if wrap else 0
        self.nbytes = 4 * plan.components(bistatic, beam)
        mode = 3 if plan.range_mode == 3 else plan.range_mode == 1 and not bistatic
        macros = {"BISTATIC": bistatic, "BEAM": beam, "LOCAL": local, "RANGE": mode}
        self.magic = float_pairs.magic(plan.steps[0]) if plan.range_mode == 3 else 0.0
        self.kernel = device.kernel("tile_constants.cl", "tile_constants", **{k: int(v) for k, v in macros.items()})

    def compute(
        self,
        pulse: object,
        n: int,
        references: object,
        radius: object,
        tiles: tuple[int, int],
        n_tiles: int,
        skip: int = 0,
    ) -> Buffer:
        """Records (end - first, n, components) float32, on the device, of the tiles (first, end) and `n` pulses.

        n                           a multiple of the device's lanes
        pulse, references, radius   on the device, as kernels/tile_constants.cl reads them; `n_tiles` tiles in all
        skip                        SKIP_WINDOW and SKIP_BEAM of kernels/tile_state.clh
        """
        first, end = tiles
        constants = self.device.empty(self.nbytes * n * (end - first))
        self.device.run(
            self.kernel, (n // self.device.info.vector_width, end - first), None,
            launch_numbers(
                "tile_constants.cl", "tile_constants", n=n, n_tiles=n_tiles, first=first, skip=skip, wrap=self.wrap,
                magic=self.magic,
            ),
            pulse, references, radius, constants,
        )  # fmt: skip
        return constants
