// Range migration straightened: range profiles of Doppler bins read where the points of each slant range lie.
//
//   out[q, i] = s~_q(t_q(i)) exp(+j 2 pi phase_q(i)),   i a column of the image
//   t_q(i) = cell + rest + (i - i0) step,   phase_q(i) = first + (i - i0) slope,   i0 the first column of its segment
//
// source    docs/theory/range_doppler.md; sarcl/imaging/range_doppler/_focus.py
// symbols   s~_q      profile of Doppler bin q, samples `oversample` times finer than 1/bandwidth
//           cell      (bins, segments) int: whole samples from delay 0;  line (bins, segments, 4): rest, step, in samples,
//                     first, slope, in cycles
//           table     (TAPS/2, 2, TERMS) as interp.clh reads it
// macros    VW as in common.clh; TAPS, TERMS of the kernel; SEGMENT columns of a segment, a multiple of VW
// reference: sarcl/reference/range_doppler.py:straighten

#include "common.clh"
#include "interp.clh"

// global size (segments, bins)
//   profiles  (bins, stride, 2): delay 0 stands at `origin`;  out (bins, segments * SEGMENT, 2)
__kernel void straighten(__global const float *restrict profiles, int stride, int origin,
                         __global const int *restrict cell, __global const float *restrict line,
                         __global const float *restrict table, __global float *restrict out) {
    size_t q = get_global_id(1), at = q * get_global_size(0) + get_global_id(0);
    __global const float *row = profiles + 2 * (q * stride + origin), *l = line + 4 * at;
    __global float *to = out + 2 * SEGMENT * at;
    float lanes[VW];
    for (int k = 0; k < VW; k++) lanes[k] = k;
    fv lane = LOAD(0, lanes);
    for (int i = 0; i < SEGMENT; i += VW) {
        fv column = lane + (float)i, re, im, s, c;
        look_up(row, stride, origin, (iv)cell[at], fma(column, (fv)l[1], (fv)l[0]), table, &re, &im);
        fv cycles = fma(column, (fv)l[3], (fv)l[2]);
        sincos_cycles(cycles - nearest(cycles), &s, &c);
        float real[VW], imaginary[VW];
        STORE(fma(re, c, -im * s), 0, real);
        STORE(fma(re, s, im * c), 0, imaginary);
        for (int k = 0; k < VW; k++) vstore2((float2)(real[k], imaginary[k]), i + k, to);
    }
}
