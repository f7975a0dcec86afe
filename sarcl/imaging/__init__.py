"""sarcl/imaging"""
