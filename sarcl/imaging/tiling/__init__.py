"""A grid in tiles, the tiles in bands: the units in which an image is made.

For other folders:

    of_grid      tiling_of(): the tiling of a grid
    plane        the tilings of planes, for pixels and for lines of them
    tiling       what every tiling offers; parts and sections of it, and their quadtrees

For this folder alone:

    _points      the tiling of listed points
"""
