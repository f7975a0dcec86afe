"""sarcl/base"""
