// Echoes of points, spread into range profiles.
//
//   g_pm[i] = sum_k a_k w_k(p, f_m) exp(-j 2 pi kappa_p delta_p(x_k)) w(i - sigma_p delta_p(x_k)),   w of interp.clh
//   s_p(f)  = sum_m L_m(f) (FFT of g_pm over w's transform), on the host;   L_m(f) Lagrange's polynomials
//
// source    the echo equation of sarcl/__init__.py; type-1 nonuniform FFT in range
// symbols   a_k          amplitude, |a|^2 = radar cross section, m^2; delta, kappa, sigma as in geometry.clh
//           w_k(p, f)    the weight of gains.clh: antennas' gains and spreading
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, RANGE, ORDER, GAINS, ALIKE, VARIES, CULL, SPREADING as in the headers
//           NODES     frequencies f_m
//           TILE      scatterers per tile, a multiple of VW
//           GROUPED   1: a work-group of 64 items adds a row up, in local memory, TILE a multiple of 64; 0: one work-item does
// reference: sarcl/reference/echo.py:echo

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "spread_sums.clh"
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#if GROUPED
#include "spread_group.clh"
#else
#define ITEMS 1
#endif

typedef struct {
    int n, n_used, n_tiles, n_offsets, second, last, flush, stride, origin;
    float range;
} spread_numbers;

// global size (pulses of this block, times the group where GROUPED; splits): work-item, or group, (p, s) adds tiles s, s + splits, ... to row (s, p).
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of all tiles
//   scatterers  (2, n_tiles TILE)    re, im of amplitude
//   nodes       (NODES)    f_m over the patterns' frequency;  patterns, second, axes (n_used, 18), range, reach (6)   see gains.clh
//   radius      (n_tiles)   m, of the points about their reference
//   last        scatterers in the last tile; the rest of it is blank
//   flush       tiles added in float32 before they join the compensated total
//   rows        (splits, n_used, NODES, 3, stride, 2)   zeroed by the caller: sum, total, its error; delay 0 at `origin`
//   done        (2, splits, n_used)    scatterers added, and left out of the beam
__kernel void spread(spread_numbers given, __global const float *restrict pulse,
                     __global const float *restrict constants, __global const float *restrict tile,
                     __global const float *restrict offsets, __global const float *restrict scatterers,
                     __global const float *restrict nodes, __global const float *restrict patterns,
                     __global const float *restrict axes, __global const float *restrict reach,
                     __global const float *restrict radius, __global const float *restrict table,
                     __global float *rows, __global int *restrict done) {
#if GROUPED
    __local row_window window;
    int p = get_global_id(0) / ITEMS, item = get_local_id(0), start = -1;
    clear_window(&window, item);
#else
    int p = get_global_id(0), item = 0;
    __global float *row = rows + 6 * (get_global_id(1) * given.n_used + p) * NODES * given.stride + 2 * given.origin;
#endif
    int split = get_global_id(1), count = 0, unlit_count = 0, added = 0;
    __global float *sum = rows + 6 * ((size_t)split * given.n_used + p) * NODES * given.stride;
    for (int k = split; k < given.n_tiles; k += get_global_size(1)) {
        __global const float *c = constants + (k * (size_t)given.n + p) * N_CONST;
        int state = as_int(c[C_STATE]);
        if (state == OUTSIDE) continue;
        int n_points = k == given.n_tiles - 1 ? given.last : TILE;
#if WEIGHTS
        direction from_tx = load_direction(c, C_UX, C_LOW);
#if BISTATIC
        direction from_rx = load_direction(c, C_RX, C_RX_LOW);
#else
        direction from_rx = from_tx;
#endif
#endif
#if CULL
        if (out_of_beam(from_tx, from_rx, radius[k], axes + 18 * (size_t)p, reach)) {
            if (item == 0) unlit_count += n_points;
            continue;
        }
#endif
        if (state == INSIDE && item == 0) count += n_points;
        for (int i = item; i < TILE / VW; i += ITEMS) {
            size_t at_vector = (size_t)k * (TILE / VW) + i;
            offset x = load_offset(offsets, at_vector, given.n_offsets);
            about_centre(&x, tile, k, given.n_tiles);
            phase_position at = locate(c, pulse, p, given.n, x);
            fv re = LOAD(at_vector, scatterers), im = LOAD(at_vector, scatterers + given.n_offsets), inside = 1;
            if (state == CROSSING) {
                inside = keep_inside(c, &at);
                re *= inside;
                im *= inside;
                float is_inside[VW];
                STORE(inside, 0, is_inside);
                for (int l = 0; l < VW; l++) count += is_inside[l] != 0 && i * VW + l < n_points;
            }
            fv sine, cosine;
            sincos_cycles(at.cycles, &sine, &cosine);
            // times exp(-j 2 pi cycles)
            fv echo_re = fma(re, cosine, im * sine), echo_im = fma(im, cosine, -re * sine);
            iv j;
            fv w[TAPS];
            tap_weights(first_tap(at.t, at.base, given.stride, given.origin, &j), table, w);
#if GROUPED
            int first = inside != 0 ? given.origin + j : NOWHERE;
#endif
#if WEIGHTS
            fv tx_range, rx_range;
            triple u_t = toward(from_tx, x, &tx_range), u_r = u_t;
            rx_range = tx_range;
#if BISTATIC
            u_r = toward(from_rx, x, &rx_range);
#endif
            antenna_view view = antenna_view_of(u_t, tx_range, u_r, rx_range, axes + 18 * (size_t)p, given.range);
            complex_v gain;
            for (int m = 0; m < NODES; m++) {
                if (m == 0 || VARIES) gain = weight(view, patterns, given.second, nodes[m]);
                complex_v weighted = c_mul(gain, c_make(echo_re, echo_im));
#if GROUPED
                __global float *sums = sum + 6 * (size_t)m * given.stride;
                start = add_scatterers(&window, sums, given.stride, start, item, first, w, (float2)(weighted.re, weighted.im));
#if NODES > 1
                // the next frequency has a row of its own
                if (start >= 0) empty_window(&window, sums, given.stride, start, item);
                start = -1;
#endif
#else
                add_taps(row + 6 * (size_t)m * given.stride, j, w, weighted.re, weighted.im);
#endif
            }
#elif GROUPED
            start = add_scatterers(&window, sum, given.stride, start, item, first, w, (float2)(echo_re, echo_im));
#else
            add_taps(row, j, w, echo_re, echo_im);
#endif
        }
#if GROUPED
        if (++added % given.flush == 0 && start >= 0) {
            empty_window(&window, sum, given.stride, start, item);
            start = -1;
        }
    }
    if (start >= 0) empty_window(&window, sum, given.stride, start, item);
    count = sum_of_items(&window, item, count);
#else
        if (++added % given.flush == 0)
            for (int m = 0; m < NODES; m++) empty_into_total(sum + 6 * (size_t)m * given.stride, given.stride);
    }
    for (int m = 0; m < NODES; m++) empty_into_total(sum + 6 * (size_t)m * given.stride, given.stride);
#endif
    size_t at = (size_t)split * given.n_used + p;
    if (item == 0) {
        done[at] = count;
        done[(size_t)get_global_size(1) * given.n_used + at] = unlit_count;
    }
}
