"""What antennas see of facets, and of the ground.

For other folders:

    illumination           lit(): sampled shares of facets, per block of pulses; facet_shares(), pixel_shares()
    lit_parts              LitParts: the part of each facet that is lit at every pulse, exactly
    rays                   SceneRays: the first facet on each ray, and whether any lies between two points
    seen_lobes             mean_lobes(): power that facets send back to an antenna along a track, by angles of incidence
    swept_shadows          never_shaded(): facets on which no shadow falls at any pulse, for certain

For this folder alone:

    _aspect_blocks         blocks of pulses that share one illumination
    _bodies                facets that hang together
    _box_tree              a tree of boxes over facets, for rays
    _certain_shadows       pairs whose shadow misses a facet, or covers it, at all pulses of a few
    _clipping              facets clipped by the shadows on them, on a device
    _facet_samples         sample points on a facet
    _frame                 facets and points on a device, in float32 coordinates of the scene
    _illumination_solver   shares of facets that given viewpoints see
    _levels_along_track    levels at as many pulses as an accuracy asks for
    _light_buffer          occlusion by facets, seen from a viewpoint outside: cells of a perspective view
    _lit_shares            shares of facets at every pulse, and of pixels, for labels and masks
    _shadow_pairs          pairs of a facet and an occluder whose shadow may fall on it
    _ray_casting           occlusion by facets, from anywhere: by a light buffer, or rays through a tree of boxes
    _viewpoints            which pulses and facets are looked at, for an error between them
"""
