"""Factorised backprojection: pulses are decimated on smaller and smaller tiles.

For other folders:

    factorized       the engine
    plan             levels of the tree, decimation and interpolation for a tolerance

For this folder alone:

    _memory          blocks within a memory limit
    _tile_chains     sides of tiles level by level, and the smooth runs of rows that are decimated
    _tile_coverage   which of the largest tiles lie in the range window and beam of which rows
"""
