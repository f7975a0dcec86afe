"""sarcl/imaging/run"""
