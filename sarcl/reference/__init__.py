"""Float64 NumPy twins of every kernel: short, slow and obviously right."""
