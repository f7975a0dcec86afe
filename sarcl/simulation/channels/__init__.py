"""sarcl/simulation/channels"""
