"""sarcl/experiments/fda"""
