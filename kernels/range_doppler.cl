// Range migration straightened: range profiles of Doppler bins read where the points of each slant range lie.
//
//   out[q, i] = s~_q(t_q(i)) exp(+j 2 pi phase_q(i)),   i a column of the image
//   t_q(i) = cell + rest + (i - i0) step,   phase_q(i) = first + (i - i0) slope,   i0 the first column of its segment
//
// source    docs/theory/range_doppler.md; sarcl/imaging/range_doppler/_bins.py
// symbols   s~_q      profile of Doppler bin q, samples `oversample` times finer than 1/bandwidth
//           cell      (bins, segments) int: whole samples from delay 0;  line (bins, segments, 4): rest, step, in samples,
//                     first, slope, in cycles
//           table     (TAPS/2, 2, TERMS) as interp.clh reads it
// macros    VW as in common.clh; TAPS, TERMS of the kernel; SEGMENT columns of a segment, a multiple of VW
// reference: sarcl/reference/range_doppler.py:straighten

#include "common.clh"
#include "interp.clh"

#if VW == 1
typedef struct {
    int stride, origin, begin, first, period, n_ranges, add;
} straighten_onto_numbers;

// global size (columns, bins), on GPUs: a work-item reads one column
//   share   (columns of the image): a factor;  begin  first column here, of the image
//   out     (..., n_ranges, 2): bin q adds to row (first + q) modulo `period`, or where `add` is 0 overwrites it
__kernel void straighten_onto(straighten_onto_numbers given, __global const float *restrict profiles,
                              __global const int *restrict cell, __global const float *restrict line,
                              __global const float *restrict table, __global const float *restrict share,
                              __global float *restrict out) {
    int stride = given.stride, origin = given.origin, begin = given.begin;
    int i = get_global_id(0), n_segments = ((int)get_global_size(0) + SEGMENT - 1) / SEGMENT;
    size_t q = get_global_id(1), at = q * n_segments + i / SEGMENT;
    __global const float *l = line + 4 * at;
    float column = i % SEGMENT, re, im, s, c;
    look_up(profiles + 2 * (q * stride + origin), stride, origin, cell[at], fma(column, l[1], l[0]), table, &re, &im);
    float cycles = fma(column, l[3], l[2]);
    sincos_cycles(cycles - nearest(cycles), &s, &c);
    size_t to = (size_t)((given.first + (int)q) % given.period) * given.n_ranges + begin + i;
    float2 made = share[begin + i] * (float2)(fma(re, c, -im * s), fma(re, s, im * c));
    vstore2(given.add ? vload2(to, out) + made : made, to, out);
}
#endif

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
