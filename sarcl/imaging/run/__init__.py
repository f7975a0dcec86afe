"""Making an image in blocks: devices, checkpoints, output files.

For other folders:

    checkpoint     when finished tiles are written, and when they are removed
    dask_workers   tiles computed by the workers of a dask.distributed cluster
    fill_bands     the bands of an image, focused by workers into an output or into tile files
    image_output   destination of pixels: memory, an array of the caller's, or a file
    tile_files     finished tiles in files beside the image, so that a stopped run can be continued
    workers        one device, or several that take their shares

For this folder alone:

    _shares        which device makes which bands of an image
"""
