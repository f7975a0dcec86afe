"""Options of the verbs for the parser of the command line, which imports nothing that takes time.

Made from the verbs' records by python docs/developers/write_options.py
"""

# verb -> option -> its default
DEFAULTS = {
    "echo": {
        "channels": "simultaneous",
        "receive": "reference",
        "skip": True,
        "receiver": None,
        "polarization": "HH",
        "vertical": None,
        "range_window": None,
        "reference": None,
        "array": None,
        "antenna": None,
        "radar": None,
        "shadows": True,
        "seed": 0,
        "compressed": True,
        "max_edge": "auto",
        "max_bytes": None,
        "out": None,
        "check": None,
        "tolerance": 0.001,
        "device": None,
        "progress": None,
    },
    "backproject": {
        "method": "auto",
        "beam": None,
        "mapping": None,
        "wrap": False,
        "skip": True,
        "out": None,
        "resume": None,
        "tile": None,
        "device": None,
        "cluster": None,
        "sum_polarizations": False,
        "window": None,
        "weights": None,
        "tolerance": 0.001,
        "max_bytes": None,
        "check": None,
        "progress": None,
    },
    "polar_format": {
        "tolerance": 0.01,
        "sum_polarizations": False,
        "window": None,
        "weights": None,
        "out": None,
        "max_bytes": None,
        "check": None,
        "device": None,
        "progress": None,
    },
    "range_doppler": {
        "heights": 0.0,
        "side": None,
        "times": None,
        "ranges": None,
        "spacing": None,
        "beam": None,
        "doppler": "geometry",
        "near": None,
        "doppler_rate": "geometry",
        "tolerance": 0.01,
        "max_bytes": None,
        "check": None,
        "window": None,
        "weights": None,
        "out": None,
        "device": None,
        "progress": None,
    },
}

# verb -> option -> the words that it takes, where it takes nothing else
CHOICES = {
    "echo": {
        "channels": ("simultaneous", "separated"),
        "receive": ("reference", "own", "all"),
    },
    "backproject": {
        "method": ("auto", "direct", "factorized"),
        "mapping": ("corrected", "apparent", "channels"),
    },
    "polar_format": {
    },
    "range_doppler": {
        "side": ("left", "right"),
    },
}

# verb -> option -> first sentence of its documentation, as argparse takes it: "%%" for "%"
HELP = {
    "echo": {
        "channels": '"simultaneous": all channels of the array are added up, each after its own matched filter, a '
        'row for every pulse and receiver; "separated": a row of its own for every pulse, sending element and '
        "receiver",
        "receive": "\"reference\": at the array's reference point; \"own\": every element receives its own channel "
        '("separated" only); "all": every element receives all',
        "skip": 'True, False or a set of reasons: "zero reflectivity", "facing away", "range window", "out of beam", '
        '"equal channels" (of one carrier and position), "interpolated channels" (from echoes at a few positions of '
        "an array to all its elements)",
        "receiver": "a track of as many pulses, default the transmitter's; its positions count as they are given",
        "polarization": '"HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": one '
        "row per pulse for each, pulse by pulse",
        "vertical": "(3,), direction: H is perpendicular to it, V in a plane with it; default z, or in Earth-centred "
        "coordinates the ellipsoid's normal at the scene's centre",
        "range_window": "(near, far) m about the reference, default the smallest that holds the scene plus 10 %%; "
        "scatterers outside it are left out, row by row",
        "reference": "point of zero phase, m (3,), default the centre of the scene's box",
        "array": "sarcl.AntennaArray at the transmitter, along the axes of the track's attitude where it has one: "
        "element n sends the waveform shifted by its offset, Hz; None: one element",
        "antenna": "sarcl.Antenna, or (transmitting, receiving), aimed by the tracks' attitude (sarcl.pointing); "
        "None: 1",
        "radar": "sarcl.Radar: amplitudes fall with range, samples are in sqrt(W); None: |sample|^2 = RCS at any range",
        "shadows": "True: of every facet only the part counts that both antennas see at each pulse "
        "(docs/theory/shadows.md; points are always seen)",
        "seed": "of the facets' random heights (scene.roughness); the same for any device and block size",
        "compressed": "False keeps the pulse's own spectrum (see `sarcl.compress`)",
        "max_edge": 'facets are cut until no edge is longer, m; "auto": as finely as the tolerance needs, rough ones '
        "at least to half a resolution cell; None: they are not cut",
        "max_bytes": "memory for blocks, default 1 GiB on CPUs, half the memory of a GPU; facets are cut into as "
        "many as it holds (512 bytes each; at least 256 MiB), by default a quarter of the machine's memory",
        "out": "an HDF5 file of sarcl's (.h5): samples are written there pulse after pulse, and read when needed",
        "check": "recompute 256 random samples exactly, fewer above 20 000 facets; None: where that costs less than "
        "2 %%",
        "tolerance": "L2 error allowed, relative to the larger of the norm of the result and the norm that it would "
        "have if contributions added with random phases",
        "device": "see `sarcl.devices`",
        "progress": "called as progress(stage, done, total)",
    },
    "backproject": {
        "method": '"direct": every pair that is not skipped; "factorized": sub-apertures; "auto": the cheapest',
        "beam": "None, or the cone in which v_p(x) is 1: its full angle, rad, about the line from the transmitter to "
        "the grid's centre (spotlight), or (angle, direction), direction (3,) or (n_rows, 3) (stripmap)",
        "mapping": "for echoes of a frequency-diverse array: the mapping that `sarcl.map_aperture` applies first, "
        '"corrected", "apparent" or "channels", or a dict of its arguments, such as {"mapping": "apparent", '
        '"center": (0, 0, 5)}',
        "wrap": "False: a row covers only |tau - tau_ref| <= 1/(2 frequency_step); True: it repeats with that period",
        "skip": 'True, False or a set of reasons ("range window", "beam", "zero weight", "no data"): pairs of rows '
        "and pixels that add nothing for these reasons are left out instead of computed; the image is the same",
        "out": 'None, a writable complex array of grid.shape (memmap, HDF5 dataset), or a path ending in ".h5"',
        "resume": 'whether finished tiles of an image at a path are kept in "PATH.parts", where the same call finds '
        "them if the run is killed",
        "tile": '(i, n): compute only piece i of n, 1 <= i <= n, and keep its tiles in "PATH.parts"; the run that '
        "completes the image assembles and returns it, the others return None",
        "device": 'see `sarcl.devices`; a list of devices, or "all", for several at once',
        "cluster": "a dask.distributed.Client whose workers compute the tiles, each on a device of its own",
        "sum_polarizations": "True: rows of several polarisations are summed coherently; False: they are refused",
        "window": 'None, "hamming", ("taylor", sidelobe_db, nbar), another name of scipy.signal.windows, such as '
        '"hann" or ("kaiser", 8.6): over samples and over rows; or a pair (range, cross-range) of these, of None, or '
        "of arrays with a weight per sample and per row of a channel",
        "weights": "one per row (n_rows,), multiplied with window and raw.weight",
        "tolerance": "L2 error allowed, relative to the larger of the norm of the result and the norm that it would "
        "have if contributions added with random phases",
        "max_bytes": "memory for blocks on each device; default 1 GiB on a CPU, half the memory of a GPU",
        "check": "recompute 256 random values of the result exactly: report.measured_error; None: where that costs "
        "less than 2 %%",
        "progress": "called as progress(stage, done, total)",
    },
    "polar_format": {
        "tolerance": "L2 error allowed against that sum, relative to the larger of the norm of I and the norm of "
        "samples that add with random phases, sqrt(pixels sum |w s|^2)",
        "sum_polarizations": "True: rows of several polarisations are summed coherently; False: they are refused",
        "window": 'None, "hamming", ("taylor", sidelobe_db, nbar), another name of scipy.signal.windows, such as '
        '"hann" or ("kaiser", 8.6): over samples and over rows; or a pair (range, cross-range) of these, of None, or '
        "of arrays with a weight per sample and per row of a channel",
        "weights": "one per row (n_rows,), multiplied with window and raw.weight",
        "out": 'None, or a path ending in ".h5": the image is written there when it is finished',
        "max_bytes": "memory for blocks on each device; default 1 GiB on a CPU, half the memory of a GPU",
        "check": "recompute 256 random values of the result exactly: report.measured_error; None: where that costs "
        "less than 2 %%",
        "device": "see `sarcl.devices`",
        "progress": "called as progress(stage, done, total)",
    },
    "range_doppler": {
        "heights": "z of the pixels, m; in Earth-fixed coordinates heights above the ellipsoid, m, or a "
        "sarcl.ElevationModel",
        "side": '"left" or "right" of the track, seen from above; None: where the origin is, if the echoes contain it',
        "times": "(first, last) zero-Doppler time, s, on the clock of raw.time, which may be absolute (2e9 s); None: "
        "those of the rows, less where a pixel's Doppler band and the image's exceed the pulse rate",
        "ranges": "(near, far) slant range, m; None: the ranges that the range window holds in every row",
        "spacing": "(s, m) between rows and columns, or None for either: the spectrum of a pixel then fills 0.8 of "
        "the sampling rate at most",
        "beam": "None: all rows contribute to every pixel",
        "doppler": 'centroid of the beam, and of the default times: "geometry", from reference ranges that change '
        '(else broadside); "data", from the phases of neighbouring rows; or in Hz, at the centre frequency',
        "near": "Hz: data determine the centroid but for multiples of the pulse rate; the one nearest to this is taken",
        "doppler_rate": 'of the azimuth compression: "geometry", from the track; "data", from the displacement of '
        "two looks (map drift), which needs ground with contrast; or in Hz/s at the centre frequency, in the middle "
        "of the ranges and at the centroid",
        "tolerance": "L2 error allowed against `backproject` at the same positions, relative to the larger of the "
        "norm of the image and the norm of the same contributions with random phases",
        "max_bytes": "memory for blocks on the device, as `backproject` takes it; arrays of all pulses or Doppler "
        "bins that are larger than a third of it, or of half the machine's memory, are temporary files",
        "check": "compute 128 random pixels exactly; None: where that costs less than 2 %%",
        "window": 'None, "hamming", ("taylor", sidelobe_db, nbar), another name of scipy.signal.windows, such as '
        '"hann" or ("kaiser", 8.6): over samples and over rows; or a pair (range, cross-range) of these, of None, or '
        "of arrays with a weight per sample and per row of a channel",
        "weights": "one per row (n_rows,), multiplied with window and raw.weight",
        "out": 'None, or a path ending in ".h5": the image is written there when it is finished',
        "device": "see `sarcl.devices`",
        "progress": "called as progress(stage, done, total)",
    },
}
