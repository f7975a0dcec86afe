"""sarcl/experiments"""
