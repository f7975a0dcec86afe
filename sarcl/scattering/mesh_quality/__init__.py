"""sarcl/scattering/mesh_quality"""
