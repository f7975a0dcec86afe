"""Factorised echoes: scatterers spread at few antenna positions about small cells, which are joined level by level.

For other folders:

    cells       scatterers in cubic cells, numbers of cells from a sample, and scatterers that all range windows hold
    levels      levels of cells, decimation and interpolation for a tolerance
    scatterers  what the kernel of the smallest cells reads of scatterers, and the sums that they make
    spreader    adds scatterers to samples by a plan of levels

For this folder alone:

    _ascent     from profiles of the smallest cells to those of pulses
    _leaves     scatterers spread into profiles of the smallest cells
"""
