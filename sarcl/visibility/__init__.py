"""The share of each facet that both antennas see.

For other folders:

    illumination       lit(): illuminated share of every facet, per block of pulses

For this folder alone:

    _aspect_blocks     blocks of pulses that share one shadow
    _embree_rays       shadows of facets, by rays of Embree (package embreex)
    _facet_samples     sample positions on a facet
    _ray_casting       shadows of facets, by rays through a tree of boxes
    _terrain_horizon   shadows of terrain, by horizons along range lines
"""

__all__ = ["illumination"]
