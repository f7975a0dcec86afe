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
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, RANGE, ORDER, NEAR, GAINS, ALIKE, VARIES, CULL, SPREADING as in the headers
//           NODES      frequencies f_m
//           PULSE_NODES  pulses that an amplitude is interpolated from; 1: each pulse has its own
//           HH, HV, VH, VV   1: wanted (first letter received)
//           METAL      1: every facet is a perfect conductor
//           DISPERSIVE 1: the materials' 1/sqrt(eps) differ from f_m to f_m; 0: those of f_0 serve all
//           ROUGH, DIAGRAM_*  see facet_planes.clh
//           SHADED     1: pulses see shares of facets; 0: all of every facet
//           PARTLY     1: lit parts of the facets, at every pulse node, stand in place of whole ones (lit_parts.cl)
//           TILE       facets per tile, a multiple of VW
//           GROUPED    1: work-groups of 64 items: each shares the facets of a tile, or adds a row up in local memory, TILE a
//                      multiple of 64; 0: each work-item does so alone
// reference: sarcl/reference/facet.py:facet_amplitude

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#include "facet.clh"
#include "facet_planes.clh"

#define CHANNELS (NODES * (HH + HV + VH + VV))
#include "spread_rows.clh"

// Amplitudes of vector i of a tile at a pulse node, and the distance from one number of them to the next: items of a group
// read and write neighbours.
#define AMPLITUDES(a, tile, i) \
    ((a) + (GROUPED ? (tile) * (2 * CHANNELS * TILE) + (i) : ((tile) * (TILE / VW) + (i)) * (2 * CHANNELS * VW)))
#define PLANE (GROUPED ? TILE : VW)
// Marks of the facets of a vector at a pulse node: a bit for each that is seen from its front, and above these bits another for
// each that sends something back.
#if VW <= 4
typedef uchar mark;
#elif VW == 8
typedef ushort mark;
#else
typedef uint mark;
#endif
#define EVERY_LANE (VW < 32 ? (1u << VW) - 1 : ~0u)

// A bit for each lane that is not 0.
static inline uint lane_bits(iv lanes) {
    int lane[VW];
    uint bits = 0;
    STORE(lanes, 0, lane);
#pragma unroll
    for (int l = 0; l < VW; l++) bits |= lane[l] != 0 ? 1u << l : 0;
    return bits;
}

static inline void put_channel(__global float *out, int channel, complex_v a, fv scale) {
    STORE(scale * a.re, 0, out + 2 * channel * PLANE);
    STORE(scale * a.im, 0, out + (2 * channel + 1) * PLANE);
}

// Writes the amplitude of one polarisation at one frequency; returns the channel of the next polarisation.
static inline int put_polarisation(__global float *out, int channel, complex_v S, complex_v mean, fv scale) {
    put_channel(out, channel, c_mul(S, mean), scale);
    return channel + NODES;
}

typedef struct {
    int n, n_offsets, second, first;
    float range;
} facet_amplitudes_numbers;

// Amplitudes at pulse nodes. global size (pulse nodes, times the group where GROUPED; tiles of this call).
//   constants  of the nodes, n of them per tile, as in backproject.cl, of all tiles
//   offsets    (2, 3, n_tiles TILE)   as in backproject.cl
//   facets   (planes, n_tiles TILE)   edges from the first corner to the second and third, m; reflectivity, negative where
//            two-sided; ROUGH: six more, see rough_mean; 1/sqrt(eps) re, im, for every f_m where DISPERSIVE
//   parts    (pulse nodes, 1 + 2 NODES, n_tiles TILE)   where PARTLY: share of the area, and mean re, im at each f_m
//   nodes    (3, NODES)               f_m/c, cycles/m; k/(2 sqrt(pi) f^e); f_m over the patterns' frequency
//   up       (6)                      vertical, and the axis that replaces it for vectors along it
//   patterns, second, axes (pulse nodes, 18), range, reach (6)   see gains.clh;  radius (n_tiles)   m, of the facets' centres
//   first    this call's first tile
//   out      (pulse nodes, tiles of this call, TILE/VW, CHANNELS, 2, VW), GROUPED: (., ., CHANNELS, 2, TILE)   re, im
//   marks    (pulse nodes, tiles of this call, TILE/VW)                    see `mark`
__kernel void facet_amplitudes(facet_amplitudes_numbers given, __global const float *restrict constants,
                               __global const float *restrict offsets, __global const float *restrict facets,
                               __global const float *restrict parts, __global const float *restrict nodes,
                               __global const float *restrict up, __global const float *restrict patterns,
                               __global const float *restrict axes, __global const float *restrict reach,
                               __global const float *restrict radius, __global float *restrict out,
                               __global mark *restrict marks) {
    int q = get_global_id(0) / ITEMS, k = given.first + get_global_id(1);
    float3 vertical = vload3(0, up), other = vload3(1, up);
    __global const float *c = constants + (k * (size_t)given.n + q) * N_CONST;
    size_t here = (size_t)q * get_global_size(1) + get_global_id(1);
    direction from_tx = load_transmitter(c), from_rx = load_receiver(c);
    int unseen = as_int(c[C_STATE]) == OUTSIDE;
    if (CULL) unseen = unseen || out_of_beam(from_tx, from_rx, radius[k], axes + 18 * (size_t)q, reach);
    for (int i = get_global_id(0) % ITEMS; i < TILE / VW; i += ITEMS) {
        size_t at = (size_t)k * (TILE / VW) + i, node_vector = here * (TILE / VW) + i;
        __global float *out_i = AMPLITUDES(out, here, i);
        offset x = load_offset(offsets, at, given.n_offsets);
        triple edge_1 = load_triple(facets + F_EDGE * (size_t)given.n_offsets, at, given.n_offsets);
        triple edge_2 = load_triple(facets + (F_EDGE + 3) * (size_t)given.n_offsets, at, given.n_offsets);
        fv factor = LOAD(at, facets + F_FACTOR * (size_t)given.n_offsets);
        fv tx_range, rx_range, twice_area;
        triple u_t = toward(from_tx, x, &tx_range), u_r = toward(from_rx, x, &rx_range), h_t, v_t, h_r, v_r;
        polarisation(u_t, vertical, other, &h_t, &v_t);
        polarisation(u_r, vertical, other, &h_r, &v_r);
        triple u_sum = BISTATIC ? t_add(u_t, u_r) : t_scale((fv)2.0f, u_t);
        triple normal = facing_normal(edge_1, edge_2, factor, u_sum, &twice_area);
        iv front = (BISTATIC ? lit_share(normal, u_t, u_r) : t_dot(normal, u_t)) > 0;
        fv amplitude = (front ? fabs(factor) : (fv)0.0f) * (fv)(unseen ? 0.0f : 0.5f) * twice_area, root_of_share = (fv)1.0f;
        __global const float *part = parts + (size_t)q * (1 + 2 * NODES) * given.n_offsets;
        if (PARTLY) {
            fv part_share = LOAD(at, part);
            root_of_share = sqrt(part_share);
            amplitude = part_share > 0 ? amplitude : (fv)0.0f;
        }
        marks[node_vector] = lane_bits(front) | lane_bits(amplitude != 0) << VW;
        if (largest(fabs(amplitude)) <= 0) {
            for (int channel = 0; channel < CHANNELS; channel++)
                put_channel(out_i, channel, c_make((fv)0.0f, (fv)0.0f), (fv)0.0f);
            continue;
        }

        fv path_1 = t_dot(u_sum, edge_1), path_2 = t_dot(u_sum, edge_2);
        scattering S;
        antenna_view view = antenna_view_of(u_t, tx_range, u_r, rx_range, axes + 18 * (size_t)q, given.range);
        complex_v gain, inverse_root = c_make((fv)0.0f, (fv)0.0f), mean;
        int coherent = is_coherent(facets + F_ROUGH * (size_t)given.n_offsets, at, given.n_offsets);
        for (int m = 0; m < NODES; m++) {
            if (m == 0 || DISPERSIVE) {
                __global const float *root_planes = facets + (F_M + 2 * m) * (size_t)given.n_offsets;
                if (!METAL) inverse_root = c_make(LOAD(at, root_planes), LOAD(at, root_planes + given.n_offsets));
                if (BISTATIC) S = scatter(normal, u_t, h_t, v_t, u_r, h_r, v_r, inverse_root);
                else S = scatter_back(normal, u_t, h_t, v_t, inverse_root);
            }
            __global const float *part_mean = part + (1 + 2 * m) * (size_t)given.n_offsets;
            if (PARTLY) mean = c_make(LOAD(at, part_mean), LOAD(at, part_mean + given.n_offsets));
            else if (coherent) mean = triangle_mean(path_1 * nodes[m], path_2 * nodes[m]);
            else mean = c_make((fv)0.0f, (fv)0.0f);
            fv along_normal = t_dot(u_sum, normal), sum_length = max(sqrt(t_dot(u_sum, u_sum)), (fv)1e-6f);
            mean = rough_mean(mean, root_of_share, along_normal * nodes[m], along_normal / sum_length, (fv)0.5f * twice_area,
                              nodes[m], facets + F_ROUGH * (size_t)given.n_offsets, at, given.n_offsets);
            if (WEIGHTS && (m == 0 || VARIES)) gain = weight(view, patterns, given.second, nodes[2 * NODES + m]);
            if (WEIGHTS) mean = c_mul(mean, gain);
            fv scale = amplitude * nodes[NODES + m];
            int channel = m;
            if (HH) channel = put_polarisation(out_i, channel, S.hh, mean, scale);
            if (HV) channel = put_polarisation(out_i, channel, S.hv, mean, scale);
            if (VH) channel = put_polarisation(out_i, channel, S.vh, mean, scale);
            if (VV) channel = put_polarisation(out_i, channel, S.vv, mean, scale);
        }
    }
}

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
    int n, n_used, n_tiles, n_offsets, first, n_here, last, flush, stride, origin;
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
//   rows     (splits, n_used, CHANNELS, 2, stride, 2)   zeroed by the caller: total, its error; delay 0 at `origin`
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
    int split = get_global_id(1), added = 0, inside_count[PULSES], front_count[PULSES], unlit_count[PULSES];
    WINDOW_SPACE row_window window;
    spread_rows into[PULSES];
    for (int r = 0; r < PULSES; r++) {
        inside_count[r] = front_count[r] = unlit_count[r] = 0;
        size_t row = (size_t)split * given.n_used + first_pulse + r;
        into[r] = begin_rows(&window, sums, rows, row, given.stride, given.origin);
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
                for (int channel = 0; channel < CHANNELS; channel++) {
                    complex_v a = c_make((fv)0.0f, (fv)0.0f);
#pragma unroll
                    for (int q = 0; q < PULSE_NODES; q++) {
                        __global const float *from_node = AMPLITUDES(amplitudes, tile_at_node[q], i) + 2 * channel * PLANE;
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
