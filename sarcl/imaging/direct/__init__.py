"""Direct backprojection in float32.

For other folders:

    direct         plan and engine: every (row, pixel) pair that is not skipped
    line_plan      plan of backprojection by lines of pixels
    tile_kernels   the kernels, pixel by pixel and line by line, and their buffers

For this folder alone:

    _line_curvature     difference of the curvature of wavefronts over a tile and a group of pulses
    _shared_line_plan   plan of backprojection by lines that a work-group shares
"""
