// Direct backprojection in float64, for tolerances below those of float32: ranges lose nothing at any distance.
//
//   I(x) = sum_p v_p(x) s~_p(2 delta_p(x)/c) exp(+j 2 pi kappa_p delta_p(x)),   delta = half path - reference range
//   |T - x| = R0 + d,   d = (|q|^2 - 2 R0 a)/(R0 + |T - x|) = -a + w/(2 R0) (1 + a/R0 + ...),   w = |q|^2 - a^2
//
// source    the image equation of sarcl/__init__.py; the quotient is the difference of two square roots, which does not
//           cancel
// symbols   T, R      antennas, m, in the caller's frame, as x is
//           x0        a tile's reference point;  q = x - x0;  u, R0 from x0 to an antenna;  a = u.q
//           kappa     2 fc/c, cycles of phase per metre;  sigma  profile samples per metre
//           limit     range window: |delta| <= limit = c/(4 df)
//           b, alpha  beam: (x - T).b >= |x - T| cos alpha
//           s~_p      range profile between its samples
// macros    VW, WRAP, TAPS, TERMS as in the headers
//           BISTATIC  1: R differs from T;  BEAM  1: pulses see only points in their beams
//           ORDER     of the series of d in q: 2, 3 or 4; 0: the quotient; -1: every path in pairs of float64
//           CHUNK     pulses added plainly before they join the compensated total
// reference: sarcl/reference/backproject.py:backproject

#include "doubledouble.clh"
#include "tile_state.clh"
#include "interp_float64.clh"

// Components of the per-pulse array, each n long.
enum { P_TX, P_TY, P_TZ, P_REFERENCE, P_KAPPA, P_KAPPA_LOW, P_SIGMA, P_SIGMA_LOW, P_LIMIT, P_LIMIT_LOW, P_RX, P_RY, P_RZ };
#define P_BX (BISTATIC ? 13 : 10)  // b, then cos and sin of alpha
// Record of a (tile, pulse): [tile][pulse][component].
enum { C_UX, C_UY, C_UZ, C_R0, C_INVERSE, C_CYCLES, C_FRAC, C_BASE, C_KAPPA, C_SIGMA, C_STATE, C_RX, C_RR = C_RX + 3, C_RINVERSE };
#define N_CONST 16
// C_STATE: see tile_state.clh

typedef struct { dv x, y, z; } point;

// T - x, each component rounded once, and its length in pairs
inline pair distance_between(dv tx, dv ty, dv tz, point x, point *d) {
    pair a = exact_sum(tx, -x.x), b = exact_sum(ty, -x.y), c = exact_sum(tz, -x.z);
    d->x = a.hi;
    d->y = b.hi;
    d->z = c.hi;
    return pair_sqrt(pair_add(pair_add(pair_mul(a, a), pair_mul(b, b)), pair_mul(c, c)));
}

// One component of VW pulses abreast (spread 0), or of one pulse for all lanes (spread 1).
inline dv of_pulse(__global const double *restrict pulse, int component, size_t n, size_t p, int spread) {
    pulse += component * n;
    if (spread) return (dv)pulse[p];
    return LOAD(p, pulse);
}
#define PULSE(component) of_pulse(pulse, component, n, p, spread)

// delta(x); also the distances R0, S0 of T and R, and the differences u, v from x to them
inline pair half_path(__global const double *restrict pulse, size_t n, size_t p, int spread, point x, pair *R0, point *u,
                      pair *S0, point *v) {
    pair path;
    *R0 = distance_between(PULSE(P_TX), PULSE(P_TY), PULSE(P_TZ), x, u);
    path = *R0;
#if BISTATIC
    *S0 = distance_between(PULSE(P_RX), PULSE(P_RY), PULSE(P_RZ), x, v);
    path = pair_add(*R0, *S0);
    path.hi *= 0.5;
    path.lo *= 0.5;
#endif
    return pair_add(path, make_pair(-PULSE(P_REFERENCE), (dv)0));
}

inline void put_direction(__global double *records, int first, int length, point d, pair r) {
    // an antenna on the reference point has no direction: any will do, R0 = 0 says so
    dv inverse = r.hi > 0 ? (dv)1 / r.hi : (dv)0;
    put(records, N_CONST, first, d.x * inverse);
    put(records, N_CONST, first + 1, d.y * inverse);
    put(records, N_CONST, first + 2, d.z * inverse);
    put(records, N_CONST, length, r.hi);
    put(records, N_CONST, length + 1, inverse);
}

// Position of delta among samples, counted from *base.
inline dv position_of(pair delta, pair sigma, dv *base) {
    pair position = pair_mul(delta, sigma);
#if WRAP
    dv periods = whole(position.hi * (1.0 / WRAP));
    position = pair_add(position, exact_product(periods, (dv)-WRAP));
#endif
    return pair_split(position, base);
}

#if BEAM
// (x - T).b - |x - T| cos alpha of d = T - x, of length r: not negative in the beam
inline dv beam_edge(__global const double *restrict pulse, size_t n, size_t p, int spread, point d, dv r, dv *along) {
    *along = -fma(d.x, PULSE(P_BX), fma(d.y, PULSE(P_BX + 1), d.z * PULSE(P_BX + 2)));
    return fma(-r, PULSE(P_BX + 3), *along);
}

// Looks at a tile, a sphere of `radius` about a point at d = T - x, of length r, through the beams of VW pulses: moves
// `state` on from what the range window says.
inline dv beam_state(__global const double *restrict pulse, size_t n, size_t p, point d, dv r, double radius, int skip,
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
#endif

// Constants that the points of a tile share, for VW pulses per work-item. global size (n/VW, tiles of this call).
//   pulse   (N_PULSE, n)            see the enum above; kappa, sigma and limit as pairs
//   tile    (3, n_tiles)            reference points, m
//   radius  (n_tiles,)              m, of the points about their reference
//   first   this call's first tile
//   skip    SKIP_WINDOW, SKIP_BEAM: leave tiles out, instead of looking at each of their points
//   out     (tiles of this call, n, N_CONST)
__kernel void tile_constants(__global const double *restrict pulse, __global const double *restrict tile,
                             __global const double *restrict radius, int n, int n_tiles, int first, int skip,
                             __global double *restrict out) {
    size_t p = get_global_id(0), k = first + get_global_id(1);
    int spread = 0;
    point x = {(dv)tile[k], (dv)tile[n_tiles + k], (dv)tile[2 * (size_t)n_tiles + k]}, u, v;
    pair R0, S0;
    pair delta = half_path(pulse, n, p, spread, x, &R0, &u, &S0, &v);
    out += (get_global_id(1) * (size_t)n + p * VW) * N_CONST;
    put_direction(out, C_UX, C_R0, u, R0);
#if BISTATIC
    put_direction(out, C_RX, C_RR, v, S0);
#endif
    pair kappa = make_pair(PULSE(P_KAPPA), PULSE(P_KAPPA_LOW)), sigma = make_pair(PULSE(P_SIGMA), PULSE(P_SIGMA_LOW));
    dv base, unused;
    put(out, N_CONST, C_CYCLES, pair_split(pair_mul(delta, kappa), &unused));
    put(out, N_CONST, C_FRAC, position_of(delta, sigma, &base));
    put(out, N_CONST, C_BASE, base);
    put(out, N_CONST, C_KAPPA, kappa.hi);
    put(out, N_CONST, C_SIGMA, sigma.hi);
    dv state = INSIDE;
#if !WRAP
    dv reach = fma(PULSE(P_LIMIT), (dv)1e-14, (dv)(radius[k] * 1.000001)), room = PULSE(P_LIMIT) - fabs(delta.hi);
    state = room >= reach ? (dv)INSIDE : (dv)CROSSING;
    if (skip & SKIP_WINDOW) state = room < -reach ? (dv)OUTSIDE : state;
#endif
#if BEAM
    state = beam_state(pulse, n, p, u, R0.hi, radius[k], skip, state);
#endif
    put(out, N_CONST, C_STATE, state);
}

// |T - x| - R0
inline dv difference(dv a, dv q, double R0, double inverse) {
#if ORDER == 0
    dv numerator = fma((dv)(-2 * R0), a, q);
    return numerator / (sqrt(fma((dv)R0, (dv)R0, numerator)) + (dv)R0);
#else
    dv w = fma(-a, a, q), bend = w * (dv)(0.5 * inverse);
#if ORDER == 2
    return bend - a;
#elif ORDER == 3
    return fma(bend, fma(a, (dv)inverse, (dv)1.0), -a);
#else
    dv t = a * (dv)inverse;
    dv next = fma((dv)(-0.25 * inverse * inverse), w, fma(t, t, t));
    return fma(bend, next + 1.0, -a);
#endif
#endif
}

// -1 in lanes whose point lies inside the range window of pulse p, else 0; decided in pairs, whatever the rest is done in
inline lv in_window(__global const double *restrict pulse, size_t n, size_t p, pair delta) {
    int spread = 1;
    dv sign = delta.hi < 0 ? (dv)1 : (dv)-1;
    pair room = pair_add(make_pair(PULSE(P_LIMIT), PULSE(P_LIMIT_LOW)), make_pair(sign * delta.hi, sign * delta.lo));
    return room.hi >= 0;
}

// global size (vectors of points per tile, tiles of this call), local size (vectors per tile, 1)
//   profiles    (n, stride, 2)        complex range profiles; delay 0 stands at sample `origin`
//   table       (TAPS/2, 2, TERMS)    see interp_float64.clh
//   pulse, constants, tile, first     as in tile_constants
//   n_used      <= n                  pulses that are real; the rest pads the vectors
//   positions   (3, pixels)           m; one tile after another
//   image       (4, pixels)           totals re, im and their errors re, im
//   skipped     (2, n_tiles)          pulses in whose window no point of the tile lies, and those in whose beam none does
__kernel void backproject(__global const double *restrict profiles, int stride, int origin,
                          __global const double *restrict table, __global const double *restrict pulse, int n,
                          int n_used, __global const double *restrict constants, __global const double *restrict tile,
                          int n_tiles, int first, __global const double *restrict positions,
                          __global double *restrict image, ulong pixels, __global int *restrict skipped) {
    size_t k = first + get_global_id(1), i = k * get_global_size(0) + get_global_id(0);
    __global const double *record = constants + get_global_id(1) * (size_t)n * N_CONST;
    point x = {LOAD(i, positions), LOAD(i, positions + pixels), LOAD(i, positions + 2 * pixels)};
    point q = {x.x - (dv)tile[k], x.y - (dv)tile[n_tiles + k], x.z - (dv)tile[2 * (size_t)n_tiles + k]};
    dv qq = fma(q.x, q.x, fma(q.y, q.y, q.z * q.z));
    int missed = 0, unlit = 0;
    for (int start = 0; start < n_used; start += CHUNK) {
        dv re = 0, im = 0;
        int stop = min(start + CHUNK, n_used);
        for (int p = start; p < stop; p++, record += N_CONST) {
            int state = convert_int(record[C_STATE]);
            if (state == OUTSIDE) {
                missed++;
                continue;
            }
#if BEAM
            if (state == UNLIT) {
                unlit++;
                continue;
            }
#endif
            // phase in cycles, and position among samples, counted from sample `base`
            dv cycles, t, base, inside = 1;
#if ORDER >= 0
            dv a = fma((dv)record[C_UX], q.x, fma((dv)record[C_UX + 1], q.y, (dv)record[C_UX + 2] * q.z));
            dv d = difference(a, qq, record[C_R0], record[C_INVERSE]);
#if BISTATIC
            a = fma((dv)record[C_RX], q.x, fma((dv)record[C_RX + 1], q.y, (dv)record[C_RX + 2] * q.z));
            d = 0.5 * (d + difference(a, qq, record[C_RR], record[C_RINVERSE]));
#endif
            cycles = fma(d, (dv)record[C_KAPPA], (dv)record[C_CYCLES]);
            cycles -= whole(cycles);
            t = fma(d, (dv)record[C_SIGMA], (dv)record[C_FRAC]);
            base = (dv)record[C_BASE];
            if (state == CROSSING)
#endif
            {
                int spread = 1;
                pair R0, S0;
                point u, v;
                pair delta = half_path(pulse, n, p, spread, x, &R0, &u, &S0, &v);
#if ORDER < 0
                dv unused;
                cycles = pair_split(pair_mul(delta, make_pair(PULSE(P_KAPPA), PULSE(P_KAPPA_LOW))), &unused);
                t = position_of(delta, make_pair(PULSE(P_SIGMA), PULSE(P_SIGMA_LOW)), &base);
#endif
#if !WRAP
                // outside, the position moves to delay 0, which every profile has, so that whatever is read there exists
                lv in = in_window(pulse, n, p, delta);
                inside = in ? inside : (dv)0;
                t = in ? t : (dv)0;
                base = in ? base : (dv)0;
#endif
#if BEAM
                dv along;
                inside = beam_edge(pulse, n, p, spread, u, R0.hi, &along) >= 0 ? inside : (dv)0;
#endif
            }
            dv w[TAPS], g, h, sine, cosine;
            lv j;
            tap_weights(first_tap(t, base, stride, origin, &j), table, w);
            weighted_sum(profiles + 2 * ((size_t)p * stride + origin), j, w, &g, &h);
            sincos_double(cycles, &sine, &cosine);
            if (state == CROSSING) {
                g *= inside;
                h *= inside;
            }
            re = fma(g, cosine, fma(-h, sine, re));
            im = fma(g, sine, fma(h, cosine, im));
        }
        add_compensated(image, image + 2 * pixels, i, re);
        add_compensated(image + pixels, image + 3 * pixels, i, im);
    }
    if (get_global_id(0) == 0) {
        skipped[k] += missed;
        skipped[n_tiles + k] += unlit;
    }
}
