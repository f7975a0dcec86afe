"""A grid in tiles, the tiles in bands: the units in which an image is made.

For other folders:

    lines        the tiling of planes for lines of pixels
    of_grid      tiling_of(): the tiling of a grid
    plane        the tiling of planes
    tiling       what every tiling offers; parts and sections of it
    tree         quadtree of tiles

For this folder alone:

    _points      the tiling of listed points
"""
