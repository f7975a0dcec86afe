"""XML files of others, whose contents are checked before they are used.

For other folders:

    parser           elements of a file without a document type
    virtual_rasters  sources of virtual rasters (VRT), where all else they hold is known to be harmless
"""
