"""sarcl/scenario"""
