"""sarcl/imaging/factorized"""
