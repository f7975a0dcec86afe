"""The share of each facet that both antennas see.

For other folders:

    illumination           lit(): illuminated share of every facet, per block of pulses
    lit_parts              LitParts: the part of each facet that is lit at every pulse, exactly

For this folder alone:

    _aspect_blocks         blocks of pulses that share one illumination
    _embree_rays           occlusion by facets, by rays of Embree (package embreex)
    _facet_samples         sample points on a facet
    _illumination_solver   shares of facets that given viewpoints see
    _shadow_pairs          pairs of a facet and an occluder whose shadow may fall on it
    _ray_casting           occlusion by facets, by rays through a tree of boxes
    _terrain_horizon       occlusion by terrain, by horizons along range lines
"""

__all__ = ["illumination", "lit_parts"]
