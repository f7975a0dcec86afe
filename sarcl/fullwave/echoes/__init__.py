"""fullwave_echo(): echoes of a track from few runs of the grid.

For other folders:

    fullwave_echo      fullwave_echo(): echoes of closed bodies, to a stated tolerance

For this folder alone:

    _antenna_geometry  range window, angles and least distance of antennas about a scene
    _closed_bodies     refusals of scenes that are not closed bodies of smooth facets
    _forecast          memory, seconds, number of runs before the work
    _formed_samples    samples of all pulses from the runs of anchors, with their errors and report
    _fullwave_task     the task of fullwave_echo: geometry, frequencies, grid, bodies cut by it
    _grid_runs         runs of the grid for one task, several at a time, and their counts
    _grid_choice       the grid: cells that carry the band, and memory
    _model_error       the grid's own error, predicted from a run with larger cells
    _options           options of fullwave_echo
    _run_bands         runs of the grid as a job that is computed in blocks
    _run_speed         speed of a device with runs, measured on a small grid
"""
