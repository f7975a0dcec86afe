"""sarcl/model"""
