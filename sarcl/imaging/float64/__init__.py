"""sarcl/imaging/float64"""
