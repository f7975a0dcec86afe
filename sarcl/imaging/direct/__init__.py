"""sarcl/imaging/direct"""
