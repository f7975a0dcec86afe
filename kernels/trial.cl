// Trial of a device: operations that every other kernel relies on, on numbers whose results the host knows.
//
//   compute   exact sums and products, a sum with a product that must not be fused, wide numbers, rounding, sine and
//             cosine, path_difference with structs by pointer, a struct by value
//   exchange  local memory of a given size, with a barrier
//   chains    a_k <- a_k x + y, over and over: timed
//
// macros    VW, FP64 as in the headers
//           NUMBER64  number type of `chains`: 1 float64, 0 float32
// reference: sarcl/opencl/_trial.py:wanted

#define BISTATIC 0
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"

#if NUMBER64
#define CHAIN_UNIT double
#else
#define CHAIN_UNIT float
#endif
#if VW == 1
typedef CHAIN_UNIT chain_v;
#define STORE_CHAIN(v, i, p) ((p)[i] = (v))
#else
typedef CAT(CHAIN_UNIT, VW) chain_v;
#define STORE_CHAIN(v, i, p) CAT(vstore, VW)(v, i, p)
#endif
#define CHAINS 8
#define NUMBERS 30

typedef struct {
    float of[NUMBERS];
} numbers;

static inline void put_wide(wv value, int i, __global float *out, int n) {
    STORE(w_float(value), i, out);
    STORE(w_low(value), i, out + n);
}

// global size (n / VW)
//   x        (10, n)  a and b, hi then lo;  a point's x, y, z, hi parts then lo parts, m
//   antenna  (2, N_PULSE)  hi then lo parts of the antenna's x, y, z and distance from the centre, m; the rest is not read
//   given    a struct by value: the sum of its numbers, each times its place
//   out      (25, n)  in the order of _trial.py:RESULTS; integers by their bits
__kernel void compute(__global const float *restrict x, __global const float *restrict antenna, int n, numbers given,
                      __global float *restrict out) {
    int i = get_global_id(0);
    fv high = LOAD(i, x), other = LOAD(i, x + 2 * n);
    pair sum = exact_sum(high, other), product = exact_product(high, other);
    STORE(sum.hi, i, out);
    STORE(sum.lo, i, out + n);
    STORE(product.hi, i, out + 2 * n);
    STORE(product.lo, i, out + 3 * n);
    wv a = w_load(x, i, n), b = w_load(x + 2 * n, i, n);
    put_wide(w_add(a, b), i, out + 4 * n, n);
    put_wide(w_mul(a, b), i, out + 6 * n, n);
    put_wide(w_div(a, b), i, out + 8 * n, n);
    put_wide(w_sqrt(a), i, out + 10 * n, n);
    iv whole;
    fv rest = w_split(a, &whole), sine, cosine;
    sincos_cycles(rest, &sine, &cosine);
    STORE(AS_FLOAT(whole), i, out + 12 * n);
    STORE(rest, i, out + 13 * n);
    STORE(sine, i, out + 14 * n);
    STORE(cosine, i, out + 15 * n);
    point at, d;
    at.x = w_load(x + 4 * n, i, 3 * n);
    at.y = w_load(x + 5 * n, i, 3 * n);
    at.z = w_load(x + 6 * n, i, 3 * n);
    wv distance, delta = path_difference(load_antenna(antenna, P_TX, 0, 1, 1), w_load1(antenna, P_TR, N_PULSE), at,
                                         &distance, &d);
    put_wide(delta, i, out + 16 * n, n);
    put_wide(distance, i, out + 18 * n, n);
    put_wide(d.y, i, out + 20 * n, n);
    float sum_of_given = 0;
#pragma unroll
    for (int k = 0; k < NUMBERS; k++) sum_of_given = fma((float)(k + 1), given.of[k], sum_of_given);
    STORE((fv)sum_of_given, i, out + 22 * n);
    pair of_product = exact_sum(high * other, other);
    STORE(of_product.hi, i, out + 23 * n);
    STORE(of_product.lo, i, out + 24 * n);
}

// global size (groups times group), in groups: each work-item writes `each` numbers to local memory and reads those of
// the item that stands opposite in its group.
//   shared   (each, group);  out (each, groups times group)
__kernel void exchange(int each, __local int *shared, __global int *restrict out) {
    int l = get_local_id(0), group = get_local_size(0), at = get_global_id(0), all = get_global_size(0);
    for (int k = 0; k < each; k++) shared[k * group + l] = k * all + at;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int k = 0; k < each; k++) out[k * all + at] = shared[k * group + group - 1 - l];
}

// global size (items): CHAINS sums per lane, of `steps` terms each;  out (items * VW)
__kernel void chains(int steps, float x, float y, __global CHAIN_UNIT *restrict out) {
    int i = get_global_id(0);
    chain_v a[CHAINS], total = 0;
#pragma unroll
    for (int k = 0; k < CHAINS; k++) a[k] = (chain_v)(CHAIN_UNIT)(i + k);
    for (int s = 0; s < steps; s++) {
#pragma unroll
        for (int k = 0; k < CHAINS; k++) a[k] = fma(a[k], (chain_v)(CHAIN_UNIT)x, (chain_v)(CHAIN_UNIT)y);
    }
#pragma unroll
    for (int k = 0; k < CHAINS; k++) total += a[k];
    STORE_CHAIN(total, i, out);
}
