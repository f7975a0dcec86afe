"""From a tolerance to a plan: error bounds, interpolation kernels, cost.

For other folders:

    cost_model              measured costs by which plans are compared
    device_profiles         range profiles made on a device, and samples from profiles that were spread there
    double_double           double-double arithmetic: products and quotients with their rounding errors
    error_bounds            error bounds of the kernels
    interpolation           interpolation kernels for range profiles
    interpolator_choice     the cheapest interpolation kernel that meets an error
    nufft2d                 two-dimensional nonuniform FFT of type 1
    plan                    the cheapest plan that meets a tolerance, and its predicted error
    polynomials             Lagrange polynomials, Chebyshev nodes
    pulse_geometry          antenna positions per pulse, as kernels/geometry.clh reads them
    range_profiles          samples in frequency to oversampled range profiles and back
    run_options             options that every verb has
    shared_tile             tiles of a grid that a work-group sums in local memory
    subapertures            pulses of a track decimated to every n-th position, and the error of that
    tile_constants          records of tiles and pulses on a device: what the points of a tile share for a pulse
    tiles                   points cut into tiles, as kernels/geometry.clh reads them
    transforms              FFTs of rows or columns of arrays that are on a device
    weighted_samples        samples times weights, turned to other reference ranges, on a device
    windows                 windows over frequency and over the aperture

For this folder alone:

    _grid_image             from a grid of wavenumbers on a device to the image, there or on the host
"""
