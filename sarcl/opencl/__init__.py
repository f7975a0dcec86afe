"""sarcl/opencl"""
