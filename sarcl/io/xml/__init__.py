"""XML files of others, whose size and contents are bounded before they are used.

For other folders:

    parser           elements of a file of bounded size, depth and number of elements
    virtual_rasters  sources of virtual rasters (VRT), where all else they hold is known to be harmless
"""

__all__ = ["parser", "virtual_rasters"]
