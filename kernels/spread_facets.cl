// Echoes of planar facets by physical optics: amplitudes at some pulses, spread into the range profiles of all.
//
//   g_pm[i] = sum_k a_k(p, f_m) exp(-j 2 pi kappa_p delta_p(x_k)) w(i - sigma_p delta_p(x_k)),   x_k centroids
//   a_k(p)  = r_k(p) sum_q c_pq a_k(q),   q pulses near p that amplitudes are computed at (pulse nodes), c Lagrange's weights,
//             r the root of the share that pulse p sees, or that share: what changes faster than amplitudes
//   s_p(f)  = f^e sum_m L_m(f) (FFT of g_pm over the kernel's transform), on the host;   L_m(f) Lagrange's polynomials
//
// source    sarcl/scattering/physical_optics.py; amplitudes interpolated between NODES frequencies f_m and between pulse nodes
//           (docs/theory/facets.md)
// symbols   a_k(p, f)  f^-e times the amplitude k/(2 sqrt(pi)) S I, and the weight of gains.clh; delta, kappa, sigma as in
//                      geometry.clh
//           in loops   p pulse, q pulse node, k tile, i vector of facets of a tile, l lane, m frequency
//           channel    one polarisation at one frequency f_m: polarisation by polarisation, each with all f_m
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, RANGE, ORDER, NEAR, CULL, TILE, GROUPED as in the headers
//           CHANNELS   of each facet; 0: their number is an argument
//           PULSE_NODES  pulses that an amplitude is interpolated from; 1: each pulse has its own
//           SHADED     1: pulses see shares of facets; 0: all of every facet
// reference: sarcl/reference/facet.py:facet_amplitude

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "vec3_complex.clh"
#include "tile_reach.clh"
#include "facet_channels.clh"
#include "spread_rows.clh"

#define EVERY_LANE (VW < 32 ? (1u << VW) - 1 : ~0u)

// r of the facets of vector `at`, 0 to 1.
static inline fv level_at(__global const uchar *levels, __global const int *moment, float between, size_t at, int n_offsets) {
    __global const uchar *one = levels + (size_t)moment[0] * n_offsets + at * VW;
    __global const uchar *two = levels + (size_t)moment[1] * n_offsets + at * VW;
    float out[VW];
#pragma unroll
    for (int l = 0; l < VW; l++) {
        float now = one[l];
        out[l] = fma(between, two[l] - now, now) * (1.0f / 255.0f);
    }
    return LOAD(0, out);
}

typedef struct {
    int n, n_used, n_tiles, n_offsets, first, n_here, last, flush, stride, origin, n_channels;
    float near;
} spread_facets_numbers;

// What facets send back at a pulse node, or between two, added to profiles. global size (pulses of this call over PULSES, times
// the group where GROUPED; splits): work-item, or group, (p, s) adds tiles s, s + splits, ... of this call to the rows of split
// s and of PULSES pulses: while a tile lies in a processor's cache.
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of all tiles
//   amplitudes, marks   of the tiles first ... first + n_here - 1, as facet_amplitudes leaves them
//   pulse_nodes (n_used, 2)           first of the PULSE_NODES nodes of a pulse, and the nearest
//   shares   (n_used, PULSE_NODES)    weights of these nodes
//   levels   (moments, n_tiles TILE)  r of each facet, 0 ... 255, at some moments
//   moments  (n_used, 2)              those around a pulse, and  between (n_used)  where it lies, 0 at the one, 1 at the other
//   axes (n_used, 18), reach, radius  see gains.clh
//   near     m, largest radius of tiles that are so small, see NEAR
//   last     facets in the last tile; the rest of it is blank
//   flush    tiles added in float32 before they join the compensated total
//   rows     (splits, n_used, n_channels, 2, stride, 2)   zeroed by the caller: total, its error; delay 0 at `origin`
//   done     (3, splits, n_used)      counts go on: facets in the range window; of those seen from their front; left out of
//            the beam
__kernel void spread_facets(spread_facets_numbers given, __global const float *restrict pulse,
                            __global const float *restrict constants, __global const float *restrict tile,
                            __global const float *restrict offsets, __global const float *restrict amplitudes,
                            __global const mark *restrict marks, __global const int *restrict pulse_nodes,
                            __global const float *restrict shares, __global const uchar *restrict levels,
                            __global const int *restrict moments, __global const float *restrict between,
                            __global const float *restrict axes, __global const float *restrict reach,
                            __global const float *restrict radius, __global const float *restrict table, __global float *sums,
                            __global float *rows, __global int *restrict done) {
    int first_pulse = get_global_id(0) / ITEMS * PULSES, n_pulses = min(PULSES, given.n_used - first_pulse);
    int n_channels = CHANNELS ? CHANNELS : given.n_channels;
    int split = get_global_id(1), added = 0, inside_count[PULSES], front_count[PULSES], unlit_count[PULSES];
    WINDOW_SPACE row_window window;
    spread_rows into[PULSES];
    for (int r = 0; r < PULSES; r++) {
        inside_count[r] = front_count[r] = unlit_count[r] = 0;
        size_t row = (size_t)split * given.n_used + first_pulse + r;
        into[r] = begin_rows(&window, sums, rows, row, n_channels, given.stride, given.origin);
    }
    for (int k = given.first + split; k < given.first + given.n_here; k += get_global_size(1)) {
        int n_facets = k == given.n_tiles - 1 ? given.last : TILE;
        for (int r = 0; r < n_pulses; r++) {
            int p = first_pulse + r, from = pulse_nodes[2 * p], nearest_node = pulse_nodes[2 * p + 1];
            __global const float *c = constants + (k * (size_t)given.n + p) * N_CONST;
            int state = as_int(c[C_STATE]);
            if (state == OUTSIDE) continue;
            if (CULL && out_of_beam(load_transmitter(c), load_receiver(c), radius[k], axes + 18 * (size_t)p, reach)) {
                if (into[r].item == 0) unlit_count[r] += n_facets;
                continue;
            }
            for (int i = into[r].item; i < TILE / VW; i += ITEMS) {
                size_t at = (size_t)k * (TILE / VW) + i, tile_at_node[PULSE_NODES];
                uint marks_near = 0;
#pragma unroll
                for (int q = 0; q < PULSE_NODES; q++) {
                    tile_at_node[q] = ((size_t)from + q) * given.n_here + (k - given.first);
                    marks_near |= marks[tile_at_node[q] * (TILE / VW) + i];
                }
                size_t at_nearest = ((size_t)nearest_node * given.n_here + (k - given.first)) * (TILE / VW) + i;
                offset x;
                phase_position where = locate_in(radius[k] <= given.near, c, pulse, p, given.n, offsets, at, given.n_offsets,
                                                 tile, k, given.n_tiles, &x);
                uint is_facet = i * VW + VW <= n_facets ? EVERY_LANE : (1u << max(n_facets - i * VW, 0)) - 1;
                fv inside = 1;
                if (state == CROSSING) {
                    inside = keep_inside(c, &where);
                    is_facet &= lane_bits(inside != 0);
                }
                inside_count[r] += popcount(is_facet);
                front_count[r] += popcount(is_facet & marks[at_nearest]);
                uint is_bright = marks_near >> VW & is_facet;
                if (SHADED) {
                    fv level = level_at(levels, moments + 2 * p, between[p], at, given.n_offsets);
                    is_bright = largest(level) > 0 ? is_bright : 0;
                    inside *= level;
                }
                if (!GROUPED && !is_bright) continue;  // items of a group go on together

                fv sine, cosine, w[TAPS];
                carrier(where, &sine, &cosine);
                sine *= inside;
                cosine *= inside;
                iv j;
                tap_weights(first_tap(where.t, where.base, given.stride, given.origin, &j), table, w);
                for (int channel = 0; channel < n_channels; channel++) {
                    complex_v a = c_make((fv)0.0f, (fv)0.0f);
#pragma unroll
                    for (int q = 0; q < PULSE_NODES; q++) {
                        __global const float *from_node = AMPLITUDES(amplitudes, n_channels, tile_at_node[q], i) + 2 * channel * PLANE;
                        fv weight_of_node = (fv)(PULSE_NODES == 1 ? 1.0f : shares[PULSE_NODES * p + q]);
                        a.re = fma(weight_of_node, LOAD(0, from_node), a.re);
                        a.im = fma(weight_of_node, LOAD(0, from_node + PLANE), a.im);
                    }
                    // times exp(-j 2 pi cycles)
                    fv echo_re = fma(a.re, cosine, a.im * sine), echo_im = fma(a.im, cosine, -a.re * sine);
                    add_scatterers(&into[r], channel, (iv)is_bright, j, w, echo_re, echo_im);
                }
            }
        }
        if (++added % given.flush == 0)
            for (int r = 0; r < n_pulses; r++) empty_rows(&into[r]);
    }
    for (int r = 0; r < n_pulses; r++) {
        empty_rows(&into[r]);
        int inside = sum_of_items(&into[r], inside_count[r]), front = sum_of_items(&into[r], front_count[r]);
        if (into[r].item == 0) {
            size_t at = (size_t)split * given.n_used + first_pulse + r, n_counts = (size_t)get_global_size(1) * given.n_used;
            done[at] += inside;
            done[n_counts + at] += front;
            done[2 * n_counts + at] += unlit_count[r];
        }
    }
}
