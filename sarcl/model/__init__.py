"""Parts of a radar and the data it records.

For other folders:

    antenna           Antenna: pattern in its own axes, mounting
    antenna_array     AntennaArray: positions and carriers of elements
    antenna_pattern   gain of a pattern in given directions, its steepest slope, its extent
    concatenation     phase histories joined by their rows
    cphd/             phase histories as CPHD files
    image             Image: pixels on a grid
    image_grid        ImageGrid: positions of the pixels
    lazy_rows         rows of arrays in files: selected, stacked, scaled and sliced without reading them
    listed_surface    positions between the points of a listed grid, and indices of positions
    maps/             images on maps, GeoTIFF files, layers of terrain
    orbit             Orbit: where a satellite is, Earth-fixed, and what it sees
    phase_history     PhaseHistory: echoes by row and frequency, with their geometry
    pointing          attitudes of tracks: spotlight, strip map, fixed
    radar             Radar: the radar equation as named factors
    row_positions     positions of both antennas in each row, from a track; of orbits at the echo's arrival
    sicd/             images as SICD files
    store             read(): files as PhaseHistory or Image; output files completed and opened as such
    trajectory        Trajectory: position of the antenna at each pulse
    waveform          Waveform: spectrum of the pulse and of its matched filter

For this folder alone:

    _costas           Costas permutations by the constructions of Welch and Golomb
    _echo_rows        axes, samples and selected rows of a PhaseHistory: methods of it
    _grid_checks      checks of what an image grid is made of
    _labelled         images and echoes as datasets of xarray: fields, coordinates, units
    _orbit_arguments  arguments of Orbit: positions, spans of time
    _row_fields       fields of a phase history with one entry per row: types and checks
    _time_record      records of samples in time: checked, with their axes
    _time_samples     samples in time as samples over frequency, for PhaseHistory.from_time
"""
