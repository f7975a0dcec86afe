// Echoes of points, spread into range profiles.
//
//   g_pm[i] = sum_k a_k w_k(p, f_m) exp(-j 2 pi kappa_p delta_p(x_k)) w(i - sigma_p delta_p(x_k)),   w of interp.clh
//   s_p(f)  = sum_m L_m(f) (FFT of g_pm over w's transform), on the host;   L_m(f) Lagrange's polynomials
//
// source    the echo equation of sarcl/__init__.py; type-1 nonuniform FFT in range
// symbols   a_k          amplitude, |a|^2 = radar cross section, m^2; delta, kappa, sigma as in geometry.clh
//           w_k(p, f)    the weight of gains.clh: antennas' gains and spreading
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, RANGE, ORDER, NEAR, GAINS, ALIKE, VARIES, CULL, SPREADING as in the headers
//           NODES     frequencies f_m
//           TILE      scatterers per tile, a multiple of VW
//           GROUPED   1: a work-group of 64 items adds a row up, in local memory, TILE a multiple of 64; 0: one work-item does
// reference: sarcl/reference/equations.py:point_echo

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#include "tile_reach.clh"
#include "spread_rows.clh"

typedef struct {
    int n, n_used, n_tiles, n_offsets, second, last, flush, stride, origin;
    float range, near;
} spread_numbers;

// global size (pulses of this block over PULSES, times the group where GROUPED; splits): work-item, or group, (p, s) adds tiles
// s, s + splits, ... to the rows of split s and of PULSES pulses.
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of all tiles
//   scatterers  (2, n_tiles TILE)    re, im of amplitude
//   nodes       (NODES)    f_m over the patterns' frequency;  patterns, second, axes (n_used, 18), range, reach (6)   see gains.clh
//   radius      (n_tiles)   m, of the points about their reference
//   near        m, largest radius of tiles that are so small, see NEAR
//   last        scatterers in the last tile; the rest of it is blank
//   flush       tiles added in float32 before they join the compensated total
//   rows        (splits, n_used, NODES, 2, stride, 2)   zeroed by the caller: total, its error; delay 0 at `origin`
//   done        (2, splits, n_used)    scatterers added, and left out of the beam
__kernel void spread(spread_numbers given, __global const float *restrict pulse,
                     __global const float *restrict constants, __global const float *restrict tile,
                     __global const float *restrict offsets, __global const float *restrict scatterers,
                     __global const float *restrict nodes, __global const float *restrict patterns,
                     __global const float *restrict axes, __global const float *restrict reach,
                     __global const float *restrict radius, __global const float *restrict table,
                     __global float *sums, __global float *rows, __global int *restrict done) {
    int first_pulse = get_global_id(0) / ITEMS * PULSES, n_pulses = min(PULSES, given.n_used - first_pulse);
    int split = get_global_id(1), added = 0, count[PULSES], unlit_count[PULSES];
    WINDOW_SPACE row_window window;
    spread_rows into[PULSES];
    for (int r = 0; r < PULSES; r++) {
        count[r] = unlit_count[r] = 0;
        size_t row = (size_t)split * given.n_used + first_pulse + r;
        into[r] = begin_rows(&window, sums, rows, row, NODES, given.stride, given.origin);
    }
    for (int k = split; k < given.n_tiles; k += get_global_size(1)) {
        int n_points = k == given.n_tiles - 1 ? given.last : TILE;
        for (int r = 0; r < n_pulses; r++) {
            int p = first_pulse + r;
            __global const float *c = constants + (k * (size_t)given.n + p) * N_CONST;
            int state = as_int(c[C_STATE]);
            if (state == OUTSIDE) continue;
            direction from_tx = load_transmitter(c), from_rx = load_receiver(c);
            if (CULL && out_of_beam(from_tx, from_rx, radius[k], axes + 18 * (size_t)p, reach)) {
                if (into[r].item == 0) unlit_count[r] += n_points;
                continue;
            }
            if (state == INSIDE && into[r].item == 0) count[r] += n_points;
            for (int i = into[r].item; i < TILE / VW; i += ITEMS) {
                size_t at_vector = (size_t)k * (TILE / VW) + i;
                offset x;
                phase_position at = locate_in(radius[k] <= given.near, c, pulse, p, given.n, offsets, at_vector, given.n_offsets,
                                              tile, k, given.n_tiles, &x);
                fv re = LOAD(at_vector, scatterers), im = LOAD(at_vector, scatterers + given.n_offsets), inside = 1;
                if (state == CROSSING) {
                    inside = keep_inside(c, &at);
                    re *= inside;
                    im *= inside;
                    float is_inside[VW];
                    STORE(inside, 0, is_inside);
                    for (int l = 0; l < VW; l++) count[r] += is_inside[l] != 0 && i * VW + l < n_points;
                }
                fv sine, cosine;
                carrier(at, &sine, &cosine);
                // times exp(-j 2 pi cycles)
                complex_v echo = c_make(fma(re, cosine, im * sine), fma(im, cosine, -re * sine));
                iv j;
                fv w[TAPS];
                tap_weights(first_tap(at.t, at.base, given.stride, given.origin, &j), table, w);
                fv tx_range, rx_range;
                triple u_t = toward(from_tx, x, &tx_range), u_r = toward(from_rx, x, &rx_range);
                antenna_view view = antenna_view_of(u_t, tx_range, u_r, rx_range, axes + 18 * (size_t)p, given.range);
                complex_v gain, weighted = echo;
                for (int m = 0; m < NODES; m++) {
                    if (WEIGHTS && (m == 0 || VARIES)) gain = weight(view, patterns, given.second, nodes[m]);
                    if (WEIGHTS) weighted = c_mul(gain, echo);
                    add_scatterers(&into[r], m, inside != 0, j, w, weighted.re, weighted.im);
                }
            }
        }
        if (++added % given.flush == 0)
            for (int r = 0; r < n_pulses; r++) empty_rows(&into[r]);
    }
    for (int r = 0; r < n_pulses; r++) {
        empty_rows(&into[r]);
        int here = sum_of_items(&into[r], count[r]);
        if (into[r].item == 0) {
            size_t at = (size_t)split * given.n_used + first_pulse + r;
            done[at] = here;
            done[(size_t)get_global_size(1) * given.n_used + at] = unlit_count[r];
        }
    }
}
