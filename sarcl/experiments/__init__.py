"""Complete experiments, from a scene to a report page.

For other folders:

    demo        `sarcl demo`: a spotlight pass over an airfield
    demo_scene  the scene of the demo, an airfield
    fda/        `sarcl fda`: apertures of frequency-diverse arrays
"""
