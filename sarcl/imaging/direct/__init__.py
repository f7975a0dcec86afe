"""Direct backprojection in float32.

For other folders:

    direct              plan and engine: every (row, pixel) pair that is not skipped
    line_plan           plan of backprojection by lines of pixels
    shared_line_plan    the same for devices whose work-groups share lines
    tile_kernels        the kernels, pixel by pixel and line by line, and their buffers
"""

__all__ = ["direct", "line_plan", "shared_line_plan", "tile_kernels"]
