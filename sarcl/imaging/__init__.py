"""backproject(), polar_format(), range_doppler(): from a phase history to an image.

For other folders:

    antenna_beam     an antenna as the beam of an image: the matched filter of its pattern
    backproject      backproject(): an image to a stated tolerance
    choose_method    the cheapest method that meets the tolerance
    compress         compress(): pulse compression
    default_grid     a grid for data that come without one
    engine           what every method offers: a plan, and an engine that makes bands on one device
    backproject_options  options of backproject, its task, and the method for some devices
    focus_options    options that the verbs which make images share
    focusing_task    the image to be made: echoes, grid, weights, geometry
    forecast         forecast of backproject; the speed of a device
    kept_results     results that are kept: of one task, or the last ones under some keys
    method_choice    the method that is chosen for a task, and choices that are kept
    pixel_taper      a taper over the aperture of each pixel
    profile_energy   energy of the range profiles against the energy at the pixels
    row_norms        norms of the rows with their weights, and a bound of the weighted samples
    strip_map        doppler_centroid(), effective_velocity(): strip maps on an equivalent straight track
    unseen_pixels    pixels outside the range window of every row
    direct/          every (row, pixel) pair that is not skipped, in float32
    factorized/      pulses decimated on a quadtree of tiles
    float64/         direct backprojection in float64
    polar_format/    polar_format(): plane wavefronts and one two-dimensional FFT
    range_doppler/   range_doppler(): FFTs along the track and in range, for near-straight tracks
    tiling/          a grid in tiles, the tiles in bands: one class for each kind of grid

For this folder alone:

    _float32_methods  plans in complex64, direct and with sub-apertures
    _image_job       an image as a job that is computed in blocks
    _image_output    destination of pixels: memory, an array of the caller's, or a file
    _row_coverage    which rows saw a pixel, and the sum of their weights: the gain of the image
"""
