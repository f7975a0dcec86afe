"""sarcl/numerics"""
