"""Direct backprojection in float64, for tolerances that complex64 cannot hold.

For other folders:

    direct           the engine
    plan             the cheapest plan and its predicted error

For this folder alone:

"""
