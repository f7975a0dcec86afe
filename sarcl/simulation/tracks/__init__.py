"""Echoes of several tracks over one scene, each with the samples of a call of its own.

For other folders:

    echoes_of_tracks  their plan: one of echo for each track

For this folder alone:

    _track_files      a folder with a file for each track, in which a killed run is continued
"""
