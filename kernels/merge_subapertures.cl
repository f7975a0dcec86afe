// Factorised backprojection: profiles of many pulses about a tile become those of fewer, about a smaller tile.
//
//   g_p(m) = sum_b w_b(z_p) s_p(k_p + m + b) exp(+j 2 pi kappa D_p),     D_p = delta_p(x') - delta_p(x)
//   G_v(m) = sum_p W(p - v) g_p(m)
//
// About the centre x' of a small tile, the contribution of a pulse to the tile's pixels changes slowly from pulse to pulse, once the
// pulse is moved to x' (first line); so a low-pass filter W can decimate the pulses (second line): every H-th antenna
// position is kept, with a profile that makes the same image of the tile.
//
// source    quadtree backprojection (McCorkle and Rofheart 1996), with interpolation between pulses instead of plain sums
// symbols   x, x'     centres of the tile the profiles are about, and of the new one, m;  delta, kappa, sigma as in geometry.clh
//           k_p, z_p  sample and fraction of D_p, see interp.clh;  m sample of the new profile, 0 at x'
//           W         (taps of W, per pulse of a block): the pulses between two kept pulses v share the kept pulses around them
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS as in the headers
//           FROM_CENTRE  1: profiles are the pulses' own, about their reference range; 0: about the tile's centre x
//           FILTER_TAPS  of W
//           SPAN         vectors of a profile per work-item; 1: on GPUs, whose work-items hold their sums in registers
// reference: sarcl/reference/merge.py:merge

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "subaperture_shift.clh"

typedef struct {
    int n_parents, n, n_used, n_tiles, first, reach, samples, stride, origin;
} shifts_numbers;

// global size (n/VW, new tiles of this call)
//   pulse   (2, N_PULSE, n)     see geometry.clh
//   parents (2, 3, n_parents)   x of the old tiles about the scene's centre, m, hi and lo parts
//   tile    (2, 3, n_tiles)     x' about the scene's centre
//   parent  (n_tiles)           which old tile a new one lies in
//   used    n_used <= n         pulses that are real
//   reach   samples before the new profiles' centre, and `samples` in all; stride, origin: of the old profiles
//   out     (tiles of this call, n_used, N_SHIFT)
__kernel void shifts(shifts_numbers given, __global const float *restrict pulse,
                     __global const float *restrict parents, __global const float *restrict tile,
                     __global const int *restrict parent, __global const float *restrict table,
                     __global float *restrict out) {
    size_t g = get_global_id(0), k = given.first + get_global_id(1);
    point x = load_point(tile, k, given.n_tiles), c = x;
    if (!FROM_CENTRE) c = load_point(parents, parent[k], given.n_parents);
    subaperture_shift shift = shift_of(pulse, g, given.n, c, x);
    // tiles that leave their rows are kept from here by the host; no rounding may touch memory that is not the row's
    int before = given.reach - given.origin;
    shift.sample = clamp(shift.sample, (iv)before, (iv)(given.stride + before - given.samples - TAPS));
    out += (get_global_id(1) * (size_t)given.n_used + g * VW) * N_SHIFT;
    store_shifts(shift, table, min(VW, given.n_used - (int)g * VW), out);
}

// WIDTH floats of interleaved complex numbers
#if VW == 1
#define WIDTH 2
#define RECORD
typedef float2 cv;
// every place of a sample is even: one load, where vload2 would make two
#define LOAD_CV(p) (*(__global const float2 *)(p))
#define STORE_CV(v, p) (*(__global float2 *)(p) = (v))
#define SWAPPED(x) (x).s10
#define IN_PAIRS(x) (x)

// Takes n numbers from a place that is even, and a multiple of four where n is.
static inline void take(__global const float *restrict from, int n, float *to) {
    if (n % 4) {
#pragma unroll
        for (int k = 0; k < n; k += 2) vstore2(*(__global const float2 *)(from + k), 0, to + k);
    } else {
#pragma unroll
        for (int k = 0; k < n; k += 4) vstore4(*(__global const float4 *)(from + k), 0, to + k);
    }
}
#else
#define WIDTH 8
#define RECORD __global
typedef float8 cv;
#define LOAD_CV(p) vload8(0, p)
#define STORE_CV(v, p) vstore8(v, 0, p)
#define SWAPPED(x) (x).s10325476
#define IN_PAIRS(x) (x).s01010101
#endif

typedef struct {
    int stride, origin, first_parent, n_used, n_blocks, reach, first, out_first, n_kept, out_stride, n_zeroed;
} merge_numbers;

// Vector v of a new profile, from an old one that a record c of `shifts` moves.
// row: the old one's place of the new one's first sample, were it not moved
static inline cv moved(__global const float *restrict row, int v, const RECORD float *c) {
    __global const float *s = row + 2 * (long)as_int(c[0]) + v * WIDTH;
    cv x = 0;
#pragma unroll
    for (int t = 0; t < TAPS; t++) x = fma(LOAD_CV(s + 2 * t), (cv)c[4 + t], x);
    return fma(SWAPPED(x), IN_PAIRS((float2)(c[2], c[3])), x * (cv)c[1]);  // times exp(+j 2 pi kappa D_p)
}

#if VW > 1
// Zeros in vectors first ... last - 1 of a profile.
static inline void clear(__global float *restrict profile, int first, int last) {
#pragma unroll 1
    for (int v = first; v < last; v++) STORE_CV((cv)0, profile + v * WIDTH);
}
#endif

// global size (spans of a profile, new tiles of this call)
//   source     profiles (old tiles from `first_parent` on, n_used, stride, 2); delay 0 or x stands at `origin`
//   shift      from `shifts`
//   blocks     (n_blocks, 4): first pulse, pulses, first kept pulse, first row of `filter`
//   filter     (rows, FILTER_TAPS): W
//   out        (tiles from out_first on, n_kept, out_stride, 2), added to; x' stands at `reach`; only the first n_zeroed
//              profiles of a tile hold numbers before
__kernel void merge(merge_numbers given, __global const float *restrict source, __global const int *restrict parent,
                    __global const float *restrict shift, __global const int *restrict blocks,
                    __global const float *restrict filter, __global float *restrict out) {
    int span = get_global_id(0) * SPAN, k = given.first + get_global_id(1);
    __global const float *records = shift + get_global_id(1) * (size_t)given.n_used * N_SHIFT;
    if (!FROM_CENTRE) source += 2 * (size_t)(parent[k] - given.first_parent) * given.n_used * given.stride;
    out += (size_t)(k - given.out_first) * given.n_kept * given.out_stride * 2;
    source += 2 * (long)(given.origin - given.reach);
#if VW == 1
    if (span >= given.out_stride) return;
    // Of the kept pulses first ... first + FILTER_TAPS - 1 the sums stay in registers: one of them leaves with each block.
    size_t row_size = 2 * (size_t)given.out_stride;
    out += 2 * span;
    int first = given.n_blocks ? min(given.n_zeroed, blocks[2]) : 0;
    cv sums[FILTER_TAPS];
#pragma unroll
    for (int a = 0; a < FILTER_TAPS; a++) sums[a] = first + a < given.n_zeroed ? LOAD_CV(out + (first + a) * row_size) : (cv)0;
    for (int b = 0; b < given.n_blocks; b++) {
        int4 block = ((__global const int4 *)blocks)[b];
        for (; first < block.z; first++) {
            STORE_CV(sums[0], out + first * row_size);
#pragma unroll
            for (int a = 0; a < FILTER_TAPS - 1; a++) sums[a] = sums[a + 1];
            sums[FILTER_TAPS - 1] = 0;  // blocks are in order: none before these has added to it
        }
        __global const float *record = records + (size_t)block.x * N_SHIFT, *row = source + 2 * (size_t)block.x * given.stride;
        __global const float *weight = filter + (size_t)block.w * FILTER_TAPS;
#pragma unroll 1
        for (int i = 0; i < block.y; i++, record += N_SHIFT, row += 2 * given.stride, weight += FILTER_TAPS) {
            float c[N_SHIFT], w[FILTER_TAPS];
            take(record, N_SHIFT, c);
            take(weight, FILTER_TAPS, w);
            cv x = moved(row, span, c);
#pragma unroll
            for (int a = 0; a < FILTER_TAPS; a++) sums[a] = fma(x, (cv)w[a], sums[a]);
        }
    }
#pragma unroll
    for (int a = 0; a < FILTER_TAPS; a++)
        if (first + a < given.n_kept) STORE_CV(sums[a], out + (first + a) * row_size);
    for (int k = max(first + FILTER_TAPS, given.n_zeroed); k < given.n_kept; k++) STORE_CV((cv)0, out + k * row_size);
#else
    int last = min(span + SPAN, (2 * given.out_stride + WIDTH - 1) / WIDTH);
    int zeroed = given.n_zeroed;
    for (int b = 0; b < given.n_blocks; b++) {
        int p0 = blocks[4 * b], count = blocks[4 * b + 1], kept = blocks[4 * b + 2], row = blocks[4 * b + 3];
        for (; zeroed < kept + FILTER_TAPS; zeroed++) clear(out + (size_t)zeroed * given.out_stride * 2, span, last);
        for (int v = span; v < last; v++) {
            cv total[FILTER_TAPS];
#pragma unroll
            for (int a = 0; a < FILTER_TAPS; a++) total[a] = 0;
            for (int i = 0; i < count; i++) {
                __global const float *w = filter + (size_t)(row + i) * FILTER_TAPS;
                cv x = moved(source + 2 * (size_t)(p0 + i) * given.stride, v, records + (size_t)(p0 + i) * N_SHIFT);
#pragma unroll
                for (int a = 0; a < FILTER_TAPS; a++) total[a] = fma(x, (cv)w[a], total[a]);
            }
#pragma unroll
            for (int a = 0; a < FILTER_TAPS; a++) {
                __global float *o = out + (size_t)(kept + a) * given.out_stride * 2 + v * WIDTH;
                STORE_CV(LOAD_CV(o) + total[a], o);
            }
        }
    }
    for (; zeroed < given.n_kept; zeroed++) clear(out + (size_t)zeroed * given.out_stride * 2, span, last);
#endif
}
