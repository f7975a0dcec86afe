"""Echoes of points: at each pulse by themselves, or factorised.

Factorised echoes spread points at few antenna positions about small cells, and join the cells level by level.

For other folders:

    direct        points to range profiles, block by block of pulses: a nonuniform FFT of type 1
    factorized    points to range profiles by a plan of levels
    point_plan    the method for a channel, and the plan of its points

For this folder alone:

    _levels       levels of cells, decimation and interpolation for a tolerance
    _point_cells  points in cubic cells, level by level
"""
