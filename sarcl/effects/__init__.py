"""sarcl/effects"""
