"""Costs by which plans are compared: one table of measured constants.

Only ratios matter within a group, since every plan is compared with plans of the same group. All were measured on PoCL,
on two cores of an AMD EPYC processor with AVX-512; the date is that of the commit that brought the numbers.
To measure them again: `python -m sarcl bench` for images, bench/echo.py for echoes, with one constant's work varied.

The unit "contribution" is one row at one pixel, or one scatterer in one row, with two taps and ranges in float32.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

# Range profiles in float32, in contributions (2026-11-21).
TAPS = {2: 1.0, 4: 1.5, 6: 1.9, 8: 2.45}  # per contribution, by number of taps
RANGE_MODE = {0: 1.0, 1: 1.5, 2: 2.2}  # per contribution, by range mode of kernels/range_phase.clh
SERIES = {3: 1.0, 0: 1.33}  # per contribution, by order of the range series; 0: exact root
# The same on GPUs. CPUs compute order 3 in the time of order 2 (ratio 1.00 with two taps), so one program serves both.
SERIES_ON_GPU = ((2, 1.0), (3, 1.05), (0, 1.33))
TILE = 20.0  # per tile and row: constants that the tile's points share

# Patches from which the images of an interpolation kernel are measured, in contributions (2026-11-22).
PATCHES = 6e7

# Backprojection by lines of pixels (kernels/backproject_lines.cl), in contributions (2026-11-21).
LINE_TAP = 0.045  # per contribution and tap of a line
LINE_SLOPE = 1.8  # factor on LINE_TAP where the curvature moves pixels' positions too
LINE_SAMPLE = 1.2  # per sample of a line's profile
LINE_WEIGHTS = 1.0  # per line and pulse: weights of its taps
LINE_PULSE = 30.0  # per tile and pulse
LINE_GROUP = 0.4  # per pixel and group of pulses

# Lines that a work-group shares (kernels/backproject_shared_lines.cl), in instructions of one lane that pass in the
# same time in kernels/backproject.cl. Measured on an NVIDIA H100 on 2026-11-27 with 8192 x 8192 pixels, 1024 pulses and
# 12 combinations of taps, fine samples and sides of tiles, which the sum gives within a tenth.
SHARED_TAP, SHARED_SLOPE_TAP = 1.75, 3.6  # per contribution and tap, of the weights and of their slopes
SHARED_READ = 2.2  # per number of local memory that a work-item reads
SHARED_SAMPLE, SHARED_SAMPLE_TAP = 68.0, 5.5  # per fine sample of a line, and per tap of its interpolation
SHARED_TURN = 84.0  # per contribution over the pulses of a group
SHARED_TILE = 13900.0  # per tile and pulse: its record and what is done with it
SHARING_PAYS = 1e7  # pairs of row and pixel below which building these kernels takes longer than they save
GATHERED = 48.2  # instructions per contribution of kernels/backproject.cl with two taps: the unit of the costs of plans

# Merging of sub-apertures, in contributions (2026-11-21).
# Per sample that is moved to a new tile: per tap of the interpolation, per tap of the filter that decimates pulses.
MOVE_TAP, MOVE_FILTER_TAP = 0.052, 0.017
MOVE_PULSE = 10.0  # per tile and pulse that is moved
MERGED_PROFILE = 6.0  # per sample of a range profile
LEAF = {64: 0.35, 32: 0.45, 16: 0.8}  # per contribution to a leaf tile computed by lines, by its side in pixels
LEAF_PIXELS = 0.1  # per contribution to a leaf tile computed pixel by pixel, on top of its taps

# Factorised echoes, in contributions (2026-11-27): fitted to seconds of single kernels, of 5e4 to 4e5 points in 16 to
# 3e4 cells and 60 to 400 pulses at tolerances of 1e-2 and 1e-4, over 4.2 ns of a contribution.
LEAF_POINT = 0.64  # per lane and kept pulse of the smallest cells, times the cost of spreading with its taps
LEAF_SAMPLE = 0.9  # per sample of a profile of a smallest cell
LEAF_FACET = 2.5  # per facet, channel and kept pulse: its amplitude
LEAF_LANES = 4.0  # lanes of a profile's vectors that hold no scatterer, about
GAIN = 2.4  # per scatterer and kept pulse, or pulse: gains of antennas, spreading loss
EXPAND_TAP, EXPAND_FILTER_TAP = 0.025, 0.035  # per sample of a cell's profile that is moved to a pulse of a larger cell
EXPAND_ROW = 20.0  # per such profile
CELL_POINT = -15.0  # per point: cells and their tables, beyond the tiles of the direct method, which take longer
LEVELS_PAY = 0.95  # share of the direct method's cost below which levels are taken: both are known to a tenth
ECHO_SEARCH_PAYS = 8e6  # cost of the direct method below which the search for levels, 1e6, takes longer than it saves
LEVELS = 4e6  # search for levels, errors of their decimations, and what any number of scatterers takes on a device
CELL_FACET = 110.0  # per facet: the same, and its numbers, which the host sorts (3.6e5 to 2.1e6 pieces, 2026-11-27)
# Pulses that a GPU adds directly while the host makes cells: 0.06 ns per pair, and 0.43 us per point more than tiles of
# the direct method take (NVIDIA H100).
PULSES_BESIDE_CELLS = 7400

# Range-Doppler images, in contributions (2026-11-22).
REFERENCED = 8.0  # per sample: weights and reference range
COMPRESSION_FILTER = 20.0  # per sample of a Doppler bin: secondary range compression
STRAIGHTENED = 8.0  # per Doppler bin and column, on top of its taps
SUMMED = 0.3  # per Doppler bin, row and column, where rows are transformed along the track by sums (2026-11-23)

# Choice of a method (2026-11-21).
MERGING_PAYS = 0.8  # share of the direct method's cost below which sub-apertures are taken
SEARCH_PAYS = 3e7  # pairs of row and pixel below which planning sub-apertures takes longer than they save
FLOAT64_UNIT = 1.3  # contributions per ns of the next group

# Backprojection in float64, in ns (2026-11-21).
FLOAT64_PAIR = 1.15  # per contribution without taps
FLOAT64_TAP = 0.23  # per contribution and tap
FLOAT64_SERIES = {4: 0.1, 0: 0.5, -1: 4.0}  # per contribution, by order; 0: exact, -1: double-double
FLOAT64_TILE = 38.0  # per tile and row
FLOAT64_SAMPLE = 10.0  # per sample of a range profile

# Two-dimensional nonuniform FFT (kernels/nufft2d.cl), in steps of a cell's FFT (2026-11-22).
GRID_UNIT = 0.5  # such a step, in contributions
GRID_SAMPLE = 30.0  # per sample
GRID_TAP = 0.9  # per sample and cell that it is spread over
GRID_CELL = 1.0  # per cell and doubling of their number

# Echoes of facets that are added directly, in contributions (2026-11-27).
FACET_PAIR = 0.76  # per facet, pulse and channel, with amplitudes interpolated between pulse nodes, and two taps

# Echoes of facets, per facet and pulse, in units of the first (2026-11-21).
FACET = 1.0  # direction, position and polarisations
FACET_NODE = 0.6  # per frequency node: the integral over the facet
FACET_TAP = 0.12  # per frequency node, polarisation and tap

# Channels of an array, in us (2026-11-22).
CHANNEL_RUN = 15.0  # per pulse of one transmitter and receiver position
CHANNEL_SAMPLE = 0.03  # per sample of that pulse's band
CHANNEL_SCATTERER = 0.003  # per scatterer in that pulse
CHANNEL_INTERPOLATED = 0.05  # per sample of an interpolated channel
INTERPOLATION_PAYS = 0.7  # share of the cost of separate channels below which interpolation is taken

# Echoes of points and facets, in us, beside which the plan of a spectral echo is short (2026-11-23).
ECHO_PULSE = 50.0  # per pulse and polarisation
ECHO_SAMPLE = 0.03  # per sample
ECHO_FACET = 0.16  # per facet

# Forecasts of echoes, in us of one core (2026-11-26). Measured: 1e5 points and 256 pulses, the scenes of the demo (6e5
# and 2.5e6 pieces), a terrain of 1.6e6 pieces and 8 pulses, a car of 1440 pieces and 96 pulses.
TILED_POINT = 0.3  # per point: order, tiles, images of the kernel
SPREAD_POINT, SPREAD_PIECE = 0.006, 0.02  # per scatterer and pulse: what echoes of many take beside ECHO_PULSE
CUT_PIECE, CUT_PIECE_ON_DEVICE = 1.6, 0.2  # per piece: cutting, judging and tiling it
LOOK_AT_PIECE, LOOKS = 0.4, 30  # per piece of a rough facet and look from a pulse; looks along a track of many pulses
# Per piece and pulse, of facets whose lit parts are computed: which parts these are, and adding them (0.25 and 0 on
# open ground, 1.4 and 1.6 for the car)
CLIPPED_PIECE, LIT_PIECE = 0.5, 0.5
JUDGED_FACET = 4.0  # per facet of a mesh or terrain: what its flat facets change of curves

# Spectral echoes, in us (2026-11-22).
LIT_PART = 20.0  # per pulse, of a facet past some ten others (2026-11-26)
SPECTRAL_POINT, SPECTRAL_FACET = 0.6, 0.05  # per scatterer and function of aspect: amplitudes, weights of antennas
SPECTRAL_PLANES = 0.4  # per facet: numbers for the kernel of the amplitudes
SPECTRAL_SPREAD = 0.1  # per scatterer spread over the map
SPECTRAL_PLAN, SPECTRAL_PLAN_POINT = 4e4, 0.35  # a plan that transforms few responses, and per point (2026-11-26)
SPECTRAL_PLANNED = 0.12  # per sample of a response that is transformed while planning (2026-11-23)
SPECTRAL_SAMPLE = 0.35  # per wavenumber along the track and frequency: transforms, and the samples read from them


def expanding(samples: float, taps: int, filter_taps: int) -> float:
    """Cost of adding a cell's profile to a pulse of a larger cell, in contributions."""
    return samples * (taps * EXPAND_TAP + filter_taps * EXPAND_FILTER_TAP) + EXPAND_ROW


class Gathering(NamedTuple):
    """Costs of backprojection pixel by pixel on a class of devices, per contribution with two taps and float32 ranges.

    taps        of 2, 4, 6 and 8 taps
    range_mode  by range mode of kernels/range_phase.clh; the last, in two float32 parts, on GPUs alone
    wavefront   of L1 per 32 contributions, which pass while instructions do; 0: memory is not counted
    fitted      interpolation kernels have as few terms as their taps allow (interpolation.fitted)
    missed      per contribution and sample of a profile beyond CACHED_SAMPLES: they are not in a core's nearest cache
    series      (order, cost) of the range series that plans choose from
    """

    taps: tuple[float, float, float, float]
    range_mode: tuple[float, ...]
    wavefront: float = 0.0
    fitted: bool = False
    missed: float = 0.0
    series: tuple[tuple[int, float], ...] = tuple(SERIES.items())

    def of_taps(self, taps: int, oversample: float, length: int = 0) -> float:
        """Cost of so many taps in profiles of `length` samples, so many times finer than 1/bandwidth."""
        instructions = self.taps[taps // 2 - 1] + self.missed * max(length - CACHED_SAMPLES, 0)
        return max(instructions, self.wavefront * taps * (1 + LINES_APART * oversample))


# Lines of 128 bytes, beyond the first, that a load of a sample for 8 x 4 pixels touches, per unit of oversampling:
# pixels half a resolution cell apart along the range, eight of them in a row.
LINES_APART = 0.25
CACHED_SAMPLES = 4000  # of the four sums of a profile that scatterers are spread into (spread_taps.clh)
# On a CPU, and from instructions on sm_90 per contribution, on 2026-11-23 (make gpu-static): on GPUs with fast float64,
# and on GPUs that compute wide numbers in pairs of float32 or with a float64 that is slower than these.
ON_CPU = Gathering((TAPS[2], TAPS[4], TAPS[6], TAPS[8]), (RANGE_MODE[0], RANGE_MODE[1], RANGE_MODE[2]))
# Spreading of points on a CPU, from seconds of spread_points.cl for 1.6e7 pairs of 5e4 to 1e6 points and 320 to 16
# pulses, in profiles of 672 to 10752 samples, on 2026-11-27: 3.9 ns with two taps.
SPREADING = Gathering((1.0, 1.09, 1.39, 1.53), ON_CPU.range_mode, missed=1e-4)
SPREADING_ON_GPU = ON_CPU._replace(series=SERIES_ON_GPU)  # order 3 takes 142 registers of sm_90 for facets, order 2 128
ON_GPU = Gathering((1.0, 1.27, 1.6, 2.02), (1.0, 1.36, 3.07, 1.17), 0.088, True, series=SERIES_ON_GPU)
ON_GPU_IN_PAIRS = Gathering((1.0, 1.27, 1.6, 2.02), (1.0, 3.98, 14.0, 1.17), 0.088, True, series=SERIES_ON_GPU)


class DeviceClass(NamedTuple):
    """What plans must know of the devices that follow them.

    lanes         they work on vectors of pixels, as CPUs do
    local_memory  bytes of local memory that the work-items of a group share; 0: they share nothing
    gathering     costs of kernels/backproject.cl
    native_error  error of the devices' own sine and cosine, rad; infinite: they are not used
    most_items    work-items of a group, at most
    """

    lanes: bool
    local_memory: int = 0
    gathering: Gathering = ON_CPU
    native_error: float = np.inf
    most_items: int = 256

    @classmethod
    def of(cls, infos: Iterable[Any], native_error: float = np.inf) -> DeviceClass:
        """Of devices (DeviceInfo) that follow one plan together."""
        infos = list(infos)
        if any(info.vector_width > 1 for info in infos):
            return cls(all(info.vector_width > 1 for info in infos))
        shared = min(min(info.local_memory, MOST_LOCAL) for info in infos)
        gathering = ON_GPU if all(info.fp64 and info.fast_fp64 for info in infos) else ON_GPU_IN_PAIRS
        return cls(False, shared, gathering, native_error, min(info.max_group for info in infos))

    def native_pays(self, tolerance: float) -> bool:
        """Whether the error of the devices' own sine and cosine is small beside a tolerance."""
        return self.native_error <= NATIVE_SHARE * tolerance


NATIVE_SHARE = 0.03  # largest share of a tolerance for the error of one sine and cosine of the device's own
MOST_LOCAL = 48 * 1024  # bytes of local memory that each NVIDIA device gives to a work-group
CPU = DeviceClass(lanes=True)


def shared_lines(side: int, fine: int, taps: int, slope_taps: int, group: int, profile_taps: int) -> float:
    """Cost per contribution of lines that a work-group shares.

    side      pixels along a side of a tile;  fine  samples of a line's profile per pixel
    taps, slope_taps, profile_taps   of the weights of lines, of their slopes, and from the range profile to the line's
    group     pulses that share a curvature
    """
    reads = (3 * fine + taps) / 4 if fine < taps else taps  # by an item with four neighbouring pixels, per pixel
    pair = SHARED_TAP * taps + SHARED_SLOPE_TAP * slope_taps + SHARED_READ * reads
    samples = fine * (SHARED_SAMPLE + SHARED_SAMPLE_TAP * profile_taps) / side
    return (pair + samples + SHARED_TILE / side**2 + SHARED_TURN / group) / GATHERED


@functools.lru_cache(maxsize=4096)
def profile(length: int) -> float:
    """Contributions per range profile of `length` samples: half of one per sample and doubling for the FFT.

    The second term is the cost of long rows that exceed the caches.
    """
    return float(length * (0.5 * np.log2(length) + length / 4000))


def float64_profile(length: int) -> float:
    """As `profile`, in float64: ns."""
    return FLOAT64_SAMPLE * length * (1 + length / 65536)
