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
//           WEIGHT    0 or 1: see pixel_weights.clh
//           CHUNK     pulses added plainly before they join the compensated total
// reference: sarcl/reference/backproject.py:backproject

#include "geometry_float64.clh"
#include "interp_float64.clh"
#include "pixel_weights.clh"

// |T - x| - R0
static inline dv difference(dv a, dv q, double R0, double inverse) {
    if (ORDER == 0) {
        dv numerator = fma((dv)(-2 * R0), a, q);
        return numerator / (sqrt(fma((dv)R0, (dv)R0, numerator)) + (dv)R0);
    }
    dv w = fma(-a, a, q), bend = w * (dv)(0.5 * inverse);
    if (ORDER == 2) return bend - a;
    if (ORDER == 3) return fma(bend, fma(a, (dv)inverse, (dv)1.0), -a);
    dv t = a * (dv)inverse;
    dv next = fma((dv)(-0.25 * inverse * inverse), w, fma(t, t, t));
    return fma(bend, next + 1.0, -a);
}

// -1 in lanes whose point lies inside the range window of pulse p, else 0; decided in pairs, whatever the rest is done in
static inline lv in_window(__global const double *restrict pulse, size_t n, size_t p, pair delta) {
    int spread = 1;
    dv sign = delta.hi < 0 ? (dv)1 : (dv)-1;
    pair room = pair_add(make_pair(PULSE(P_LIMIT), PULSE(P_LIMIT_LOW)), make_pair(sign * delta.hi, sign * delta.lo));
    return room.hi >= 0;
}

typedef struct {
    ulong pixels;
    int stride, origin, n, n_used, n_tiles, first;
} backproject_numbers;

// global size (vectors of points per tile, tiles of this call), local size (vectors per tile, 1)
//   profiles    (n, stride, 2)        complex range profiles; delay 0 stands at sample `origin`
//   table       (TAPS/2, 2, TERMS)    see interp_float64.clh
//   pulse, constants, tile, first     as in tile_constants_float64.cl
//   n_used      <= n                  pulses that are real; the rest pads the vectors
//   positions   (3, pixels)           m; one tile after another
//   image       (4, pixels)           totals re, im and their errors re, im
//   place       (n_used), taper (TAPER), aperture (2, pixels): start and inverse; not read where WEIGHT is 0
//   skipped     (2, n_tiles)          pulses in whose window no point of the tile lies, and those in whose beam none does
__kernel void backproject(backproject_numbers given, __global const double *restrict profiles,
                          __global const double *restrict table, __global const double *restrict pulse,
                          __global const double *restrict constants, __global const double *restrict tile,
                          __global const double *restrict positions, __global double *restrict image,
                          __global int *restrict skipped, __global const double *restrict place,
                          __global const double *restrict taper, __global const double *restrict aperture) {
    size_t k = given.first + get_global_id(1), i = k * get_global_size(0) + get_global_id(0), pixels = given.pixels;
    int n = given.n, n_used = given.n_used, n_tiles = given.n_tiles, stride = given.stride, origin = given.origin;
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
            if (BEAM && state == UNLIT) {
                unlit++;
                continue;
            }
            // phase in cycles, and position among samples, counted from sample `base`
            dv cycles, t, base, inside = 1;
            if (ORDER >= 0) {
                dv a = fma((dv)record[C_UX], q.x, fma((dv)record[C_UX + 1], q.y, (dv)record[C_UX + 2] * q.z));
                dv d = difference(a, qq, record[C_R0], record[C_INVERSE]);
                if (BISTATIC) {
                    a = fma((dv)record[C_RX], q.x, fma((dv)record[C_RX + 1], q.y, (dv)record[C_RX + 2] * q.z));
                    d = 0.5 * (d + difference(a, qq, record[C_RR], record[C_RINVERSE]));
                }
                cycles = fma(d, (dv)record[C_KAPPA], (dv)record[C_CYCLES]);
                cycles -= whole(cycles);
                t = fma(d, (dv)record[C_SIGMA], (dv)record[C_FRAC]);
                base = (dv)record[C_BASE];
            }
            if (ORDER < 0 || state == CROSSING) {
                int spread = 1;
                pair R0, S0;
                point u, v;
                pair delta = half_path(pulse, n, p, spread, x, &R0, &u, &S0, &v);
                if (ORDER < 0) {
                    dv unused;
                    cycles = pair_split(pair_mul(delta, make_pair(PULSE(P_KAPPA), PULSE(P_KAPPA_LOW))), &unused);
                    t = position_of(delta, make_pair(PULSE(P_SIGMA), PULSE(P_SIGMA_LOW)), WRAP, &base);
                }
                if (!WRAP) {
                    // outside, the position moves to delay 0, which every profile has, so that whatever is read there exists
                    lv in = in_window(pulse, n, p, delta);
                    inside = in ? inside : (dv)0;
                    t = in ? t : (dv)0;
                    base = in ? base : (dv)0;
                }
                if (BEAM) {
                    dv along;
                    inside = beam_edge(pulse, n, p, spread, u, R0.hi, &along) >= 0 ? inside : (dv)0;
                }
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
            if (TAPERED) {
                dv weight = taper_weight(taper, ((dv)place[p] - LOAD(i, aperture)) * LOAD(i, aperture + pixels));
                g *= weight;
                h *= weight;
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
