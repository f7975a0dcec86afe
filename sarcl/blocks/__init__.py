"""A result computed in blocks: by one device or several, by the workers of a cluster, and over several runs.

Images and echoes use it alike. A result is divided in bands, a block is a run of consecutive bands.

For other folders:

    bands          the division of a result in bands; what computes a block, and what it returns
    block_options  options of the verbs whose results are computed in blocks
    block_job      one result that is computed in blocks, and what identifies it
    checkpoint     when finished tiles are written, and when they are removed
    dask_workers   blocks computed by the workers of a dask.distributed cluster
    fill_bands     the bands of a result, computed by workers into an output or into tile files
    tile_files     finished bands in files beside the result, so that a stopped run can be continued
    workers        one device, or several that take their shares

For this folder alone:

    _shares        which device computes which bands
"""
