// Amplitudes of planar facets by physical optics, which spread_facets.cl adds to range profiles.
//
//   a_k(q, f_m) = f_m^-e k/(2 sqrt(pi)) S I w,   q pulse nodes, e as in spread_facets.cl
//
// source    sarcl/scattering/physical_optics.py (docs/theory/facets.md)
// symbols   S, I       scattering and phase integral of facet.clh;  w weight of gains.clh
//           in loops   q pulse node, k tile, i vector of facets of a tile, m frequency
// macros    VW, FP64, RANGE, ORDER, BISTATIC, GAINS, ALIKE, VARIES, CULL, SPREADING, TILE, GROUPED as in the headers
//           NODES      frequencies f_m; 0: their number is an argument
//           HH, HV, VH, VV   1: wanted (first letter received)
//           METAL      1: every facet is a perfect conductor
//           DISPERSIVE 1: the materials' 1/sqrt(eps) differ from f_m to f_m; 0: those of f_0 serve all
//           ROUGH, DIAGRAM_*  see facet_planes.clh
//           PARTLY     1: lit parts of the facets, at every pulse node, stand in place of whole ones (lit_parts.cl)
// reference: sarcl/reference/facet.py:facet_amplitude

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "tile_paths.clh"
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#include "tile_reach.clh"
#include "facet.clh"
#include "facet_planes.clh"
#include "facet_channels.clh"

#define ITEMS (GROUPED ? 64 : 1)

static inline void put_channel(__global float *out, int channel, complex_v a, fv scale) {
    STORE(scale * a.re, 0, out + 2 * channel * PLANE);
    STORE(scale * a.im, 0, out + (2 * channel + 1) * PLANE);
}

// Writes the amplitude of one polarisation at one frequency; returns the channel of the next polarisation.
static inline int put_polarisation(__global float *out, int channel, int n_nodes, complex_v S, complex_v mean, fv scale) {
    put_channel(out, channel, c_mul(S, mean), scale);
    return channel + n_nodes;
}

typedef struct {
    int n, n_offsets, second, first, n_nodes, record;
    float range;
} facet_amplitudes_numbers;

// Amplitudes at pulse nodes. global size (pulse nodes, times the group where GROUPED; tiles of this call).
//   constants  of the nodes, n of them per tile, as in backproject.cl, of all tiles; each of `record` numbers
//   offsets    (2, 3, n_tiles TILE)   as in backproject.cl
//   facets   (planes, n_tiles TILE)   edges from the first corner to the second and third, m; reflectivity, negative where
//            two-sided; ROUGH: six more, see rough_mean; 1/sqrt(eps) re, im, for every f_m where DISPERSIVE
//   parts    (pulse nodes, 1 + 2 n_nodes, n_tiles TILE)   where PARTLY: share of the area, and mean re, im at each f_m
//   nodes    (3, n_nodes)               f_m/c, cycles/m; k/(2 sqrt(pi) f^e); f_m over the patterns' frequency
//   up       (6)                      vertical, and the axis that replaces it for vectors along it
//   patterns, second, axes (pulse nodes, 18), range, reach (6)   see gains.clh;  radius (n_tiles)   m, of the facets' centres
//   first    this call's first tile
//   out      (pulse nodes, tiles of this call, TILE/VW, channels, 2, VW), GROUPED: (., ., channels, 2, TILE)   re, im
//   marks    (pulse nodes, tiles of this call, TILE/VW)                    see `mark`
__kernel void facet_amplitudes(facet_amplitudes_numbers given, __global const float *restrict constants,
                               __global const float *restrict offsets, __global const float *restrict facets,
                               __global const float *restrict parts, __global const float *restrict nodes,
                               __global const float *restrict up, __global const float *restrict patterns,
                               __global const float *restrict axes, __global const float *restrict reach,
                               __global const float *restrict radius, __global float *restrict out,
                               __global mark *restrict marks) {
    int q = get_global_id(0) / ITEMS, k = given.first + get_global_id(1);
    int n_nodes = NODES ? NODES : given.n_nodes, n_channels = n_nodes * (HH + HV + VH + VV);
    float3 vertical = vload3(0, up), other = vload3(1, up);
    __global const float *c = constants + (k * (size_t)given.n + q) * given.record;
    size_t here = (size_t)q * get_global_size(1) + get_global_id(1);
    direction from_tx = load_transmitter(c), from_rx = load_receiver(c);
    int unseen = as_int(c[C_STATE]) == OUTSIDE;
    if (CULL) unseen = unseen || out_of_beam(from_tx, from_rx, radius[k], axes + 18 * (size_t)q, reach);
    for (int i = get_global_id(0) % ITEMS; i < TILE / VW; i += ITEMS) {
        size_t at = (size_t)k * (TILE / VW) + i, node_vector = here * (TILE / VW) + i;
        __global float *out_i = AMPLITUDES(out, n_channels, here, i);
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
        __global const float *part = parts + (size_t)q * (1 + 2 * n_nodes) * given.n_offsets;
        if (PARTLY) {
            fv part_share = LOAD(at, part);
            root_of_share = sqrt(part_share);
            amplitude = part_share > 0 ? amplitude : (fv)0.0f;
        }
        marks[node_vector] = lane_bits(front) | lane_bits(amplitude != 0) << VW;
        if (largest(fabs(amplitude)) <= 0) {
            for (int channel = 0; channel < n_channels; channel++)
                put_channel(out_i, channel, c_make((fv)0.0f, (fv)0.0f), (fv)0.0f);
            continue;
        }

        fv path_1 = t_dot(u_sum, edge_1), path_2 = t_dot(u_sum, edge_2);
        scattering S;
        antenna_view view = antenna_view_of(u_t, tx_range, u_r, rx_range, axes + 18 * (size_t)q, given.range);
        complex_v gain, inverse_root = c_make((fv)0.0f, (fv)0.0f), mean;
        int coherent = is_coherent(facets + F_ROUGH * (size_t)given.n_offsets, at, given.n_offsets);
        for (int m = 0; m < n_nodes; m++) {
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
            if (WEIGHTS && (m == 0 || VARIES)) gain = weight(view, patterns, given.second, nodes[2 * n_nodes + m]);
            if (WEIGHTS) mean = c_mul(mean, gain);
            fv scale = amplitude * nodes[n_nodes + m];
            int channel = m;
            if (HH) channel = put_polarisation(out_i, channel, n_nodes, S.hh, mean, scale);
            if (HV) channel = put_polarisation(out_i, channel, n_nodes, S.hv, mean, scale);
            if (VH) channel = put_polarisation(out_i, channel, n_nodes, S.vh, mean, scale);
            if (VV) channel = put_polarisation(out_i, channel, n_nodes, S.vv, mean, scale);
        }
    }
}
