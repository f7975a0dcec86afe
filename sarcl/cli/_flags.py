"""Options of the verbs for the parser of the command line, which imports nothing that takes time.

Made from the verbs' records by python docs/developers/write_options.py
"""

# verb -> option -> its default
DEFAULTS = {
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
    "backproject": {
        "method": ("auto", "direct", "factorized"),
        "mapping": ("corrected", "apparent", "channels"),
    },
    "polar_format": {},
    "range_doppler": {
        "side": ("left", "right"),
    },
}

# verb -> option -> first sentence of its documentation, as argparse takes it: "%%" for "%"
HELP = {
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
        "tolerance": "L2 error allowed against the sum of plane waves, relative to the larger of the norm of I and "
        "the norm of samples that add with random phases, sqrt(pixels sum |w s|^2)",
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
        "beam": "the azimuth beam, full angle in rad about the Doppler centroid: rows that see a pixel outside it do "
        "not contribute; None: all rows contribute to every pixel",
        "doppler": 'centroid of the beam, and of the default times: "geometry", from reference ranges that change '
        '(else broadside); "data", from the phases of neighbouring rows; or in Hz, at the centre frequency',
        "near": "Hz: data determine the centroid but for multiples of the pulse rate; the one nearest to this is taken",
        "doppler_rate": 'that of the azimuth compression: "geometry", from the track; "data", from the displacement '
        "of two looks (map drift), which needs ground with contrast; or in Hz/s at the centre frequency, in the "
        "middle of the ranges and at the centroid",
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
