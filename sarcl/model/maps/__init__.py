"""Images on maps: grids of a map's pixels, and images resampled to them.

For other folders:

    antennas       positions of the antennas that a part of an image was made from
    map_grid       pixels on a regular grid of a map
    picture_axes   axes of pictures of images, in metres or of a map
    saving         Image.save of GeoTIFF files

For this folder alone:

    _resampling    an image resampled to a map, block by block
    _source        positions of an image's pixels on a map, and the places of a map in the image
"""
