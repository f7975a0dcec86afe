"""sarcl/imaging/polar_format"""
