"""sarcl/analysis"""
