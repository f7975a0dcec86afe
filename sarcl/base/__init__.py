"""Tools for every room, without any radar in them.

For other folders:

    arguments     checks of arguments that are no numbers: names of files, words, functions, indices
    boxes         bounding boxes of points and their corners
    constants     the speed of light
    counter_rng   random numbers computed from a seed and a counter: independent of order and blocks
    errors        warnings and errors of the library; a warning points to the user's line that called it
    fingerprint   checksums of everything that a result depends on
    float_pairs   sums with their rounding error; float64 as pairs of float32, for devices without float64
    forecast      Forecast: what a verb would do; Plan: what it carries out
    host_memory   memory of the machine, and arrays in temporary files
    morton        Morton order: neighbours in space become neighbours in memory
    options       records of options: type, default, check and documentation of each
    progress      progress bar for verbs: echo(..., progress=Bar())
    report        Report: plan, errors, counts and seconds of a verb
    rows          some rows spread over all, and groups of rows by keys
    stage_timer   seconds per stage of a computation
    text          bytes, durations, tolerances and spelling suggestions for messages; tables for notebooks
    threads       how many processors computations of this process use, and NumPy on all of them
    tolerances    tolerances that a refusal names: rounded up, and tried until one is met
    types         types of arguments that several rooms take
    validation    checks of user input: name, got, wanted, remedy
    vectors       unit vectors, scalar products
    verb          a verb: a function whose options are a record, and whose work is planned before it runs
    version       the version of the package
    wgs84         longitude, latitude and height to Earth-centred coordinates and back; local axes
"""
