// Records of tiles and pulses: what the points of a tile share for a pulse, in pairs of float64.
//
// A program of its own, so that it is compiled for the few macros that it depends on: not for every interpolation kernel and
// every length of a profile.
//
// source    geometry_float64.clh
// symbols   delta, kappa, sigma, u, R0   as in geometry_float64.clh
// macros    VW, BISTATIC, BEAM as in the headers
// reference: sarcl/reference/geometry.py:half_path

#include "geometry_float64.clh"

static inline void put_direction(__global double *records, int first, int length, point d, pair r) {
    // an antenna on the reference point has no direction: any will do, R0 = 0 says so
    dv inverse = r.hi > 0 ? (dv)1 / r.hi : (dv)0;
    put(records, N_CONST, first, d.x * inverse);
    put(records, N_CONST, first + 1, d.y * inverse);
    put(records, N_CONST, first + 2, d.z * inverse);
    put(records, N_CONST, length, r.hi);
    put(records, N_CONST, length + 1, inverse);
}

// Looks at a tile, a sphere of `radius` about a point at d = T - x, of length r, through the beams of VW pulses: moves
// `state` on from what the range window says.
static inline dv beam_state(__global const double *restrict pulse, size_t n, size_t p, point d, dv r, double radius, int skip,
                            dv state) {
    dv along;
    beam_edge(pulse, n, p, 0, d, r, &along);
    dv across = sqrt(fmax(fma(r, r, -along * along), (dv)0)), cosine = LOAD(p, pulse + (P_BX + 3) * (size_t)n);
    dv sine = LOAD(p, pulse + (P_BX + 4) * (size_t)n), reach = fma(r, (dv)1e-7, (dv)(radius * 1.000001));
    dv lit = beam_side(along, across, r, cosine, sine, reach);
    dv seen = state != OUTSIDE ? (dv)1 : (dv)0;
    if (skip & SKIP_BEAM) state = lit * seen < 0 ? (dv)UNLIT : state;
    dv partly = state == INSIDE ? (dv)1 - lit : (dv)0;
    return partly > 0 ? (dv)CROSSING : state;
}

typedef struct {
    int n, n_tiles, first, skip, wrap;
} tile_constants_numbers;

// Constants that the points of a tile share, for VW pulses per work-item. global size (n/VW, tiles of this call).
//   pulse   (N_PULSE, n)            see geometry_float64.clh; kappa, sigma and limit as pairs
//   tile    (3, n_tiles)            reference points, m
//   radius  (n_tiles,)              m, of the points about their reference
//   first   this call's first tile
//   skip    SKIP_WINDOW, SKIP_BEAM: leave tiles out, instead of looking at each of their points
//   wrap    M > 0: profiles repeat every M samples; 0: they do not
//   out     (tiles of this call, n, N_CONST)
__kernel void tile_constants(tile_constants_numbers given, __global const double *restrict pulse,
                             __global const double *restrict tile, __global const double *restrict radius,
                             __global double *restrict out) {
    size_t p = get_global_id(0), k = given.first + get_global_id(1);
    int n = given.n, n_tiles = given.n_tiles, skip = given.skip, wrap = given.wrap, spread = 0;
    point x = {(dv)tile[k], (dv)tile[n_tiles + k], (dv)tile[2 * (size_t)n_tiles + k]}, u, v;
    pair R0, S0;
    pair delta = half_path(pulse, n, p, spread, x, &R0, &u, &S0, &v);
    out += (get_global_id(1) * (size_t)n + p * VW) * N_CONST;
    put_direction(out, C_UX, C_R0, u, R0);
    if (BISTATIC) put_direction(out, C_RX, C_RR, v, S0);
    pair kappa = make_pair(PULSE(P_KAPPA), PULSE(P_KAPPA_LOW)), sigma = make_pair(PULSE(P_SIGMA), PULSE(P_SIGMA_LOW));
    dv base, unused;
    put(out, N_CONST, C_CYCLES, pair_split(pair_mul(delta, kappa), &unused));
    put(out, N_CONST, C_FRAC, position_of(delta, sigma, wrap, &base));
    put(out, N_CONST, C_BASE, base);
    put(out, N_CONST, C_KAPPA, kappa.hi);
    put(out, N_CONST, C_SIGMA, sigma.hi);
    dv state = INSIDE;
    if (!wrap) {
        dv reach = fma(PULSE(P_LIMIT), (dv)1e-14, (dv)(radius[k] * 1.000001)), room = PULSE(P_LIMIT) - fabs(delta.hi);
        state = room >= reach ? (dv)INSIDE : (dv)CROSSING;
        if (skip & SKIP_WINDOW) state = room < -reach ? (dv)OUTSIDE : state;
    }
    if (BEAM) state = beam_state(pulse, n, p, u, R0.hi, radius[k], skip, state);
    put(out, N_CONST, C_STATE, state);
}
