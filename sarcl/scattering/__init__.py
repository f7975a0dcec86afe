"""sarcl/scattering"""
