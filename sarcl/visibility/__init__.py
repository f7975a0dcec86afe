"""sarcl/visibility"""
