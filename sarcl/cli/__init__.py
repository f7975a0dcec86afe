"""sarcl/cli"""
