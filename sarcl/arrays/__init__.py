"""sarcl/arrays"""
