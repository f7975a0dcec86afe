"""fullwave_echo(): echoes of a track from few runs of the grid.

For other folders:

    fullwave_echo      fullwave_echo(): echoes of closed bodies, to a stated tolerance

For this folder alone:

    _anchor_files      echoes of finished anchors in files, so that a killed run can be continued
    _anchor_runs       runs of the grid for the anchors of one polarisation that is sent, and their counts
    _antenna_geometry  range window, angles and least distance of antennas about a scene
    _closed_bodies     refusals of scenes that are not closed bodies of smooth facets
    _forecast          memory, seconds, number of runs before the work
    _formed_samples    samples of all pulses from the runs of anchors, with their errors and report
    _fullwave_task     the task of fullwave_echo: geometry, frequencies, grid, bodies cut by it
    _grid_choice       the grid: cells that carry the band, and memory
    _model_error       the grid's own error, predicted from a run with larger cells
    _options           options of fullwave_echo
    _run_progress      progress of several runs
    _run_speed         speed of a device with runs, measured on a small grid
"""
