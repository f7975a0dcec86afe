// Factorised echoes: points of a small tile, spread into profiles of the tile's own, for the pulses that are kept there.
//
//   G_v[i] = sum_k a_k exp(-j 2 pi kappa_v delta_v(x_k)) w(i - sigma_v delta_v(x_k)),   delta about the tile's centre, w of interp.clh
//
// source    type-1 nonuniform FFT in range, before the adjoint of quadtree backprojection (expand_subapertures.cl)
// symbols   a_k   amplitude, |a|^2 = radar cross section, m^2; delta, kappa, sigma as in geometry.clh
// macros    VW, FP64, BISTATIC, TAPS, TERMS, RANGE, ORDER as in the headers; records with LOCAL
//           STRIDE  samples of a profile, a multiple of 8; delay 0 stands at STRIDE/2
// reference: sarcl/reference/equations.py:point_echo

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"

#if VW == 1
#define COPIES 1
#else
#define COPIES 4  // neighbouring lanes add to rows of their own: a load need not wait for the store before it
#endif

typedef struct {
    int n, n_used, n_tiles, n_offsets, first;
} leaves_numbers;

// global size (kept pulses, tiles of this call): one work-item per profile
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of the tiles of this call, from `first` on
//   vectors     (n_tiles + 1) first vector of VW points of each tile
//   scatterers  (2, n_offsets)    re, im of amplitude; 0 where vectors are filled up
//   out         (tiles of this call, n_used, STRIDE, 2)
__kernel void leaves(leaves_numbers given, __global const float *restrict pulse, __global const float *restrict constants,
                     __global const float *restrict tile, __global const float *restrict offsets,
                     __global const int *restrict vectors, __global const float *restrict scatterers,
                     __global const float *restrict table, __global float *restrict out) {
    int p = get_global_id(0), k = given.first + get_global_id(1);
    __global const float *c = constants + (get_global_id(1) * (size_t)given.n + p) * N_CONST;
    __global float *row = out + 2 * (size_t)STRIDE * (get_global_id(1) * (size_t)given.n_used + p);
#if VW == 1
    for (int i = 0; i < STRIDE; i++) vstore2((float2)(0, 0), i, row);
#else
    float copies[COPIES][2 * STRIDE];
    for (int q = 0; q < COPIES; q++)
        for (int i = 0; i < 2 * STRIDE; i++) copies[q][i] = 0;
#endif
    for (int i = vectors[k]; i < vectors[k + 1]; i++) {
        tile_point x = load_tile_point(offsets, i, given.n_offsets, tile, k, given.n_tiles, 0);
        phase_position at = locate(c, pulse, p, given.n, x);
        fv re = LOAD(i, scatterers), im = LOAD(i, scatterers + given.n_offsets), sine, cosine;
        carrier(at, &sine, &cosine);
        fv a = fma(re, cosine, im * sine), b = fma(im, cosine, -re * sine);  // times exp(-j 2 pi cycles)
        iv j;
        fv w[TAPS];
        tap_weights(first_tap(at.t, at.base, STRIDE, STRIDE / 2, &j), table, w);
#if VW == 1
#pragma unroll
        for (int q = 0; q < TAPS; q++) {
            __global float *s = row + 2 * (STRIDE / 2 + j + q);
            vstore2(vload2(0, s) + (float2)(w[q] * a, w[q] * b), 0, s);
        }
#else
        int first[VW];
        float re_of[VW], im_of[VW], weight[TAPS][VW];
        STORE(j, 0, first);
        STORE(a, 0, re_of);
        STORE(b, 0, im_of);
#pragma unroll
        for (int q = 0; q < TAPS; q++) STORE(w[q], 0, weight[q]);
#pragma unroll
        for (int l = 0; l < VW; l++) {
            float4 v = (float4)(re_of[l], im_of[l], re_of[l], im_of[l]);
#pragma unroll
            for (int q = 0; q < TAPS; q += 2) {
                float *s = copies[l % COPIES] + 2 * (STRIDE / 2 + first[l] + q);
                float4 tap = (float4)(weight[q][l], weight[q][l], weight[q + 1][l], weight[q + 1][l]);
                vstore4(fma(tap, v, vload4(0, s)), 0, s);
            }
        }
#endif
    }
#if VW > 1
    for (int i = 0; i < 2 * STRIDE; i += 8)
        vstore8((vload8(0, copies[0] + i) + vload8(0, copies[1] + i)) + (vload8(0, copies[2] + i) + vload8(0, copies[3] + i)), 0, row + i);
#endif
}
