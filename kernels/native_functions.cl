// Sine and cosine by the device's own functions, so that their error can be measured.
//
// source    common.clh:sincos_cycles
// macros    NATIVE as in common.clh
// reference: sarcl/opencl/native_functions.py:sincos_error

#undef VW
#define VW 1
#include "common.clh"

// cycles (n), |cycles| <= 1/2; out (2, n): sine, cosine. global size (n)
__kernel void native_sincos(__global const float *restrict cycles, __global float *restrict out) {
    size_t i = get_global_id(0), n = get_global_size(0);
    float sine, cosine;
    sincos_cycles(cycles[i], &sine, &cosine);
    out[i] = sine;
    out[n + i] = cosine;
}
