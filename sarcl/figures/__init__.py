"""sarcl/figures"""
