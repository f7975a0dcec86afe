"""sarcl/phase_correction"""
