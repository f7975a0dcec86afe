// Factorised echoes: scatterers of a small tile, spread into profiles of the tile's own, for the antenna positions kept there.
//
//   G_v[i] = sum_k a_k(v) exp(-j 2 pi kappa_v delta_v(x_k)) w(i - sigma_v delta_v(x_k)),   delta about the tile's centre, w of
//            interp.clh
//
// source    type-1 nonuniform FFT in range, before the adjoint of quadtree backprojection (expand_subapertures.cl)
// symbols   a_k(v)  amplitude of a point, |a|^2 = radar cross section, m^2, or of a facet, as in facet_amplitudes.cl; with the weight
//                   of gains.clh; delta, kappa, sigma as in geometry.clh
// macros    VW, FP64, BISTATIC, TAPS, TERMS, RANGE, ORDER, GAINS, ALIKE, VARIES, SPREADING as in the headers; records with LOCAL
//           ROOM    samples that a profile has at most, where VW > 1
//           FACETS  1: scatterers are facets; 0: points
//           HH, HV, VH, VV, METAL, ROUGH, DIAGRAM_*  as in facet_amplitudes.cl, where FACETS; one polarisation alone
//           COHERENT  1: some facets have a coherent part
// reference: sarcl/reference/equations.py:point_echo, sarcl/reference/facet.py:facet_amplitude

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#if FACETS
#include "facet.clh"
#include "facet_planes.clh"
#endif

#if VW == 1
#define COPIES 1
#else
#define COPIES 4  // neighbouring lanes add to rows of their own: a load need not wait for the store before it
#endif

// wave: f/c, cycles/m; scale: k/(2 sqrt(pi) f^e); ratio: f over the patterns' frequency; range: R of gains.clh
typedef struct {
    int n, n_used, n_tiles, n_offsets, first, root, second, stride;
    float wave, scale, ratio, range;
} leaves_numbers;

#if FACETS
// Amplitudes of the facets of vector i, without weights; *front: those that are seen from their front.
static inline complex_v facet_amplitude(leaves_numbers given, __global const float *restrict facets, size_t i, triple u_t, triple u_r,
                                        __global const float *restrict up, iv *front) {
    size_t n = given.n_offsets;
    float3 vertical = vload3(0, up), other = vload3(1, up);
    triple edge_1 = load_triple(facets + F_EDGE * n, i, n), edge_2 = load_triple(facets + (F_EDGE + 3) * n, i, n);
    triple h_t, v_t, h_r, v_r;
    fv factor = LOAD(i, facets + F_FACTOR * n), twice_area;
    polarisation(u_t, vertical, other, &h_t, &v_t);
    polarisation(u_r, vertical, other, &h_r, &v_r);
    triple u_sum = BISTATIC ? t_add(u_t, u_r) : t_scale((fv)2.0f, u_t);
    triple normal = facing_normal(edge_1, edge_2, factor, u_sum, &twice_area);
    *front = (BISTATIC ? lit_share(normal, u_t, u_r) : t_dot(normal, u_t)) > 0;
    fv scale = (*front ? fabs(factor) : (fv)0.0f) * (fv)(0.5f * given.scale) * twice_area;
    complex_v inverse_root = c_make((fv)0.0f, (fv)0.0f), mean = inverse_root;
    __global const float *roots = facets + given.root * n;
    if (!METAL) inverse_root = c_make(LOAD(i, roots), LOAD(i, roots + n));
    scattering S;
    if (BISTATIC) S = scatter(normal, u_t, h_t, v_t, u_r, h_r, v_r, inverse_root);
    else S = scatter_back(normal, u_t, h_t, v_t, inverse_root);
    if (COHERENT) mean = triangle_mean(t_dot(u_sum, edge_1) * given.wave, t_dot(u_sum, edge_2) * given.wave);
    fv along_normal = t_dot(u_sum, normal), sum_length = max(sqrt(t_dot(u_sum, u_sum)), (fv)1e-6f);
    mean = rough_mean(mean, (fv)1.0f, along_normal * given.wave, along_normal / sum_length, (fv)0.5f * twice_area, given.wave,
                      facets + F_ROUGH * n, i, n);
    return c_scale(scale, c_mul(HH ? S.hh : HV ? S.hv : VH ? S.vh : S.vv, mean));
}
#endif

// global size (kept pulses, tiles of this call): one work-item per profile
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of the tiles of this call, from `first` on
//   vectors     (n_tiles + 1) first vector of VW scatterers of each tile
//   scatterers  (planes, n_offsets)  re, im of amplitude; or facets as in facet_amplitudes.cl, 1/sqrt(eps) from plane `root` on;
//               0 where vectors are filled up
//   up          (6)                  as in facet_amplitudes.cl, where FACETS
//   patterns, second, axes (n_used, 18)   see gains.clh
//   stride      samples of a profile, a multiple of 8; delay 0 stands at stride/2
//   out         (tiles of this call, n_used, stride, 2)
//   fronts      (tiles of this call, n_used)   number of facets that are seen from their front
__kernel void leaves(leaves_numbers given, __global const float *restrict pulse, __global const float *restrict constants,
                     __global const float *restrict tile, __global const float *restrict offsets,
                     __global const int *restrict vectors, __global const float *restrict scatterers,
                     __global const float *restrict up, __global const float *restrict patterns,
                     __global const float *restrict axes, __global const float *restrict table, __global float *restrict out,
                     __global int *restrict fronts) {
    int p = get_global_id(0), k = given.first + get_global_id(1), stride = given.stride;
    __global const float *c = constants + (get_global_id(1) * (size_t)given.n + p) * N_CONST;
    __global float *row = out + 2 * (size_t)stride * (get_global_id(1) * (size_t)given.n_used + p);
#if VW == 1
    for (int i = 0; i < stride; i++) vstore2((float2)(0, 0), i, row);
#else
    float copies[COPIES][2 * ROOM + 16];  // not 4096 bytes apart: a load would wait for stores to the others
    for (int q = 0; q < COPIES; q++)
        for (int i = 0; i < 2 * stride; i++) copies[q][i] = 0;
#endif
    direction from_tx = load_transmitter(c), from_rx = load_receiver(c);
    int n_front = 0;
    for (int i = vectors[k]; i < vectors[k + 1]; i++) {
        tile_point x = load_tile_point(offsets, i, given.n_offsets, tile, k, given.n_tiles, 0);
        phase_position at = locate(c, pulse, p, given.n, x);
        fv sine, cosine;
        complex_v amplitude;
#if FACETS || WEIGHTS
        fv tx_range, rx_range;
        offset p_near = load_offset(offsets, i, given.n_offsets);
        triple u_t = toward(from_tx, p_near, &tx_range), u_r = toward(from_rx, p_near, &rx_range);
#endif
#if FACETS
        iv front;
        amplitude = facet_amplitude(given, scatterers, i, u_t, u_r, up, &front);
        int is_front[VW];
        STORE(front, 0, is_front);
#pragma unroll
        for (int l = 0; l < VW; l++) n_front += is_front[l] != 0;
#else
        amplitude = c_make(LOAD(i, scatterers), LOAD(i, scatterers + given.n_offsets));
#endif
#if WEIGHTS
        antenna_view view = antenna_view_of(u_t, tx_range, u_r, rx_range, axes + 18 * (size_t)p, given.range);
        amplitude = c_mul(amplitude, weight(view, patterns, given.second, given.ratio));
#endif
        fv re = amplitude.re, im = amplitude.im;
        carrier(at, &sine, &cosine);
        fv a = fma(re, cosine, im * sine), b = fma(im, cosine, -re * sine);  // times exp(-j 2 pi cycles)
        iv j;
        fv w[TAPS];
        tap_weights(first_tap(at.t, at.base, stride, stride / 2, &j), table, w);
#if VW == 1
#pragma unroll
        for (int q = 0; q < TAPS; q++) {
            __global float *s = row + 2 * (stride / 2 + j + q);
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
                float *s = copies[l % COPIES] + 2 * (stride / 2 + first[l] + q);
                float4 tap = (float4)(weight[q][l], weight[q][l], weight[q + 1][l], weight[q + 1][l]);
                vstore4(fma(tap, v, vload4(0, s)), 0, s);
            }
        }
#endif
    }
#if VW > 1
    for (int i = 0; i < 2 * stride; i += 8)
        vstore8((vload8(0, copies[0] + i) + vload8(0, copies[1] + i)) + (vload8(0, copies[2] + i) + vload8(0, copies[3] + i)), 0, row + i);
#endif
    if (FACETS) fronts[get_global_id(1) * (size_t)given.n_used + p] = n_front;
}
