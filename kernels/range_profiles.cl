// Range profiles of samples on the device, and samples of spread profiles: what comes before and after the FFT of rows.
//
//   P_p(m) = sum_n w_p v_n s_p(n) exp(+j 2 pi (n - low) m/length),     low = n_samples/2, rounded down
//
// `weigh` lays sample n at bin low - n (modulo length) of a row of zeros, so that the FFT, which has exp(-j ...), needs no
// normalisation afterwards as an inverse FFT would. `pad` copies the transform to a profile whose padding repeats its
// other end. For profiles that were spread, `fold` adds the padding to where it was copied from, and `cut` takes the
// bins of the samples from the transform.
//
// symbols   w, v   weights of rows and of samples, pairs of float32: a product is rounded once, as on the host
// macros    REAL64  number type of the profiles: 1 float64, 0 float32
//           FROM64  number type of the samples: 1 float64, where the device has it, 0 float32
// reference: sarcl/numerics/range_profiles.py:from_samples, sarcl/numerics/range_profiles.py:to_samples

#undef VW
#define VW 1  // for pairs of single numbers, on every device
#include "common.clh"

#if FROM64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define GIVEN double
#else
#define GIVEN float
#endif

// global size (length, rows)
//   samples  (n_along, n_samples, 2), of which rows from `first` on are taken
//   across   (2, n_samples): v, its value and its rest;  along  (2, n_along): w;  in float64 values alone
//   out      (rows, length, 2)
__kernel void weigh(__global const GIVEN *restrict samples, int n_samples, __global const REAL *restrict across,
                    __global const REAL *restrict along, int n_along, int first, __global REAL *restrict out) {
    int bin = get_global_id(0), length = get_global_size(0), row = first + get_global_id(1), low = n_samples / 2;
    int n = bin <= low ? low - bin : low + length - bin;
    REAL re = 0, im = 0;
    if (n < n_samples) {
        size_t i = 2 * ((size_t)row * n_samples + n);
#if REAL64
        REAL w = along[row] * across[n];
        re = samples[i] * w;
        im = samples[i + 1] * w;
#elif FROM64
        double w = ((double)along[row] + along[n_along + row]) * ((double)across[n] + across[n_samples + n]);
        re = convert_float(samples[i] * w);
        im = convert_float(samples[i + 1] * w);
#else
        pair w = pair_mul(make_pair(along[row], along[n_along + row]), make_pair(across[n], across[n_samples + n]));
        re = fma(samples[i], w.hi, samples[i] * w.lo);
        im = fma(samples[i + 1], w.hi, samples[i + 1] * w.lo);
#endif
    }
    size_t o = 2 * (get_global_id(1) * (size_t)length + bin);
    out[o] = re;
    out[o + 1] = im;
}

// global size (length + 2 padding, rows)
//   from  (rows, length, 2);  out (rows, length + 2 padding, 2) from row `first` on
__kernel void pad(__global const REAL *restrict from, int length, int padding, int first, __global REAL *restrict out) {
    int at = get_global_id(0), i = (at - padding) % length;
    size_t row = get_global_id(1);
    i += i < 0 ? length : 0;
    size_t source = 2 * (row * length + i), o = 2 * ((first + row) * get_global_size(0) + at);
    out[o] = from[source];
    out[o + 1] = from[source + 1];
}

typedef struct { int parts, n_rows, planes, padding, first; } fold_numbers;

// global size (length, rows)
//   sums  (parts, n_rows, planes, length + 2 padding, 2) from row `first` on: profiles are the sums of all parts, and of the
//         last two planes, a total and its rest
//   out   (rows, length, 2)
__kernel void fold(fold_numbers given, __global const REAL *restrict sums, __global REAL *restrict out) {
    int bin = get_global_id(0), length = get_global_size(0), stride = length + 2 * given.padding;
    size_t row = given.first + get_global_id(1);
    pair re = make_pair(0, 0), im = make_pair(0, 0);
    for (int part = 0; part < given.parts; part++) {
        __global const REAL *total = sums + 2 * ((part * (size_t)given.n_rows + row + 1) * given.planes - 2) * stride;
        __global const REAL *rest = total + 2 * stride;
        for (int at = (bin + given.padding) % length; at < stride; at += length) {
            re = pair_add(re, exact_sum(total[2 * at], rest[2 * at]));
            im = pair_add(im, exact_sum(total[2 * at + 1], rest[2 * at + 1]));
        }
    }
    size_t o = 2 * (get_global_id(1) * (size_t)length + bin);
    out[o] = re.hi + re.lo;
    out[o + 1] = im.hi + im.lo;
}

// global size (n_samples, rows)
//   spectra     (rows, length, 2), transforms
//   correction  (n_samples): factors of the samples
//   out         (rows, n_samples, 2) from row `first` on
__kernel void cut(__global const REAL *restrict spectra, int length, __global const REAL *restrict correction, int first,
                  __global REAL *restrict out) {
    int n = get_global_id(0), n_samples = get_global_size(0), bin = n - n_samples / 2;
    size_t row = get_global_id(1), source = 2 * (row * length + (bin < 0 ? bin + length : bin));
    size_t o = 2 * ((first + row) * n_samples + n);
    out[o] = correction[n] * spectra[source];
    out[o + 1] = correction[n] * spectra[source + 1];
}
