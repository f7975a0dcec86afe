"""Float64 NumPy twins of kernels and of verbs without a kernel: short, slow and obviously right.

Tests, the check= code of simulation and imaging, and the benchmark import them; plans never do. The twins of facet.clh,
gains.clh and pattern.clh are formulas that plans need too: scattering/physical_optics, scattering/antenna_weights and
model/antenna_pattern.

For other folders:

    backproject    the image equation, term by term
    bounces        echoes that facets reflect to one another, by every sequence of facets
    certain_shadows  shadows that miss a facet, or cover it, whatever antenna of several casts them
    edges          echoes of edges by short elements
    equations      delay, echo, matched filter, image, array, full-wave updates, waveform forming: in a textbook's order
    facet          echo of triangular facets by physical optics; past and through thin sheets, by small pieces and rays
    facet_pieces   pieces of rough facets, and their random numbers
    fdtd           layers, bodies and incident waves of a Yee grid
    geometry       half the two-way path less the reference range
    image          multilooking
    interp         interpolation of one profile
    linear         the echo of points as a matrix
    lit_part       the part of a facet that is in no shadow
    map_drift      correlation and displacement of two looks along the track
    merge          profiles about a tile's centre, and their decimation
    mie            echoes of a sphere
    polar_format   the image of plane waves, and the spreading of samples on a grid
    quality        a point response by brute force
    range_doppler  reading of a profile along the range migration
    rays           the first facet on a ray, and whether any lies between two points
    shadow         which samples of facets are hidden
    spectral_echo  spectrum of a reflectivity map, and the steps of its grid
    transposition  what comes before and after an FFT of columns
    weighted_samples  samples times weights, turned to other reference ranges
"""
