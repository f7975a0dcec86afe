"""sarcl/scene"""
