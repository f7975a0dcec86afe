"""Factorised echoes: points are spread at few antenna positions about small cells, and cells are joined level by level.

For other folders:

    levels        levels of cells, decimation and interpolation for a tolerance
    point_cells   points in cubic cells, level by level
    spreader      points to range profiles by such a plan
"""
