"""sarcl/simulation"""
