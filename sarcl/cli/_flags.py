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
        "sum_polarizations": False,
        "out": None,
        "resume": None,
        "tile": None,
        "device": None,
        "cluster": None,
        "window": None,
        "weights": None,
        "tolerance": 0.001,
        "max_bytes": None,
        "check": None,
        "progress": None,
    },
}

# verb -> option -> the words that it takes, where it takes nothing else
CHOICES = {
    "backproject": {
        "method": ("auto", "direct", "factorized"),
        "mapping": ("corrected", "apparent", "channels"),
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
        "sum_polarizations": "True: rows of several polarisations are summed coherently; False: they are refused",
        "out": 'None, a writable complex array of grid.shape (memmap, HDF5 dataset), or a path ending in ".h5"',
        "resume": 'whether finished tiles of an image at a path are kept in "PATH.parts", where the same call finds '
        "them if the run is killed",
        "tile": '(i, n): compute only piece i of n, 1 <= i <= n, and keep its tiles in "PATH.parts"; the run that '
        "completes the image assembles and returns it, the others return None",
        "device": 'see `sarcl.devices`; a list of devices, or "all", for several at once',
        "cluster": "a dask.distributed.Client whose workers compute the tiles, each on a device of its own",
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
}
