// Samples times the weights of rows and samples, turned to other reference ranges; and their energy.
//
//   out_p(n) = w_p v_n s_p(n) exp(+j 2 pi (a_p + n b_p))
//
// symbols   s_p(n)   sample n of row p
//           w, v     weights of rows and of samples, pairs of float32: a product is rounded once, as on the host
//           a, b     cycles of a row's first sample, and from one to the next, wide numbers: n b is many cycles
// macros    FP64     of doubleword.clh
//           FROM64   number type of the samples: 1 float64, where the device has it, 0 float32
// reference: sarcl/reference/weighted_samples.py:turned

#undef VW
#define VW 1  // for pairs of single numbers, on every device
#include "common.clh"
#include "doubleword.clh"

#if FROM64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define GIVEN double
#else
#define GIVEN float
#endif

#define PARTS 32  // sums per row

// global size (n_samples, rows)
//   samples  (rows, n_samples, 2);  across (2, n_samples): v;  along (6, rows): w, a and b, each a value and its rest
//   out      (..., n_samples, 2) from row `first` on
__kernel void weigh_and_turn(__global const GIVEN *restrict samples, __global const float *restrict across,
                             __global const float *restrict along, int rows, int first, __global float *restrict out) {
    int n = get_global_id(0), n_samples = get_global_size(0), p = get_global_id(1), whole;
    size_t i = (size_t)p * n_samples + n;
    wv turn = w_mul(w_load(along, p + 4 * (size_t)rows, rows), w_make((float)n, 0));
    float s, c;
    sincos_cycles(w_split(w_add(w_load(along, p + 2 * (size_t)rows, rows), turn), &whole), &s, &c);
#if FROM64
    double w = ((double)along[p] + along[rows + p]) * ((double)across[n] + across[n_samples + n]);
    float re = convert_float(samples[2 * i] * w), im = convert_float(samples[2 * i + 1] * w);
#else
    pair w = pair_mul(make_pair(along[p], along[rows + p]), make_pair(across[n], across[n_samples + n]));
    float2 given = vload2(i, samples);
    float re = fma(given.s0, w.hi, given.s0 * w.lo), im = fma(given.s1, w.hi, given.s1 * w.lo);
#endif
    vstore2((float2)(fma(re, c, -im * s), fma(re, s, im * c)), i + (size_t)first * n_samples, out);
}

// global size (PARTS, rows): sums of the squares of every PARTS-th sample
//   samples  (rows, n_samples, 2) from row `first` on;  scale  a factor that keeps squares among float32
//   sums     (..., PARTS) from row `to` on
__kernel void energies(__global const float *restrict samples, int n_samples, int first, float scale, int to,
                       __global float *restrict sums) {
    int part = get_global_id(0);
    size_t row = get_global_id(1);
    float sum = 0;
    for (int n = part; n < n_samples; n += PARTS) {
        float2 s = scale * vload2((first + row) * n_samples + n, samples);
        sum += fma(s.s0, s.s0, s.s1 * s.s1);
    }
    sums[(to + row) * PARTS + part] = sum;
}
