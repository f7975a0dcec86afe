// Echoes of points in float64: the transpose of backproject_float64.cl, with the same records, weights and phases.
//
//   s~_p[j + k] = sum_x v_p(x) g_p(x) a(x) w_k(t_p(x)) exp(-j 2 pi kappa_p delta_p(x))
//
// source    the echo equation of sarcl/__init__.py; type-1 nonuniform FFT in range
// symbols   delta, kappa, v_p, t as in point_path_float64.clh;  w_k, j as in interp_float64.clh;  g of gains_float64.clh
// macros    VW, WRAP, TAPS, TERMS, BISTATIC, BEAM, ORDER, WEIGHT, GAINS, ALIKE as in the headers
// reference: sarcl/reference/linear.py:spread

#include "geometry_float64.clh"
#include "interp_float64.clh"
#include "pixel_weights.clh"
#include "point_path_float64.clh"
#include "gains_float64.clh"

typedef struct {
    ulong pixels;
    int stride, origin, n, n_used, n_tiles, first, n_run, vectors;
} spread_numbers;

// Adds (re + j im) w[k] to samples j + k, lane by lane: lanes may meet in one sample.
static inline void add_taps(__global double *row, lv j, const dv *w, dv re, dv im) {
#if VW == 1
    __global double *q = row + 2 * j;
#pragma unroll
    for (int k = 0; k < TAPS; k++) vstore2(vload2(k, q) + (double2)(w[k] * re, w[k] * im), k, q);
#else
    long at[VW];
    double a[VW], b[VW], lane[TAPS][VW];
    STORE(j, 0, at);
    STORE(re, 0, a);
    STORE(im, 0, b);
#pragma unroll
    for (int k = 0; k < TAPS; k++) STORE(w[k], 0, lane[k]);
#pragma unroll
    for (int l = 0; l < VW; l++) {
        __global double *q = row + 2 * at[l];
#pragma unroll
        for (int k = 0; k < TAPS; k++) vstore2(vload2(k, q) + lane[k][l] * (double2)(a[l], b[l]), k, q);
    }
#endif
}

// global size (n_used, splits): work-item (p, s) adds tiles s, s + splits, ... of this call to its own rows of pulse p
//   pulse, constants, tile, positions, table, place, taper, aperture   as in backproject_float64.cl
//   n_run, vectors   tiles of this call, and vectors of points in a tile
//   amplitudes  (2, pixels)    re, im
//   rows        (splits, n_used, stride, 2)   added to; delay 0 stands at sample `origin`
__kernel void spread(spread_numbers given, __global const double *restrict table, __global const double *restrict pulse,
                     __global const double *restrict constants, __global const double *restrict tile,
                     __global const double *restrict positions, __global const double *restrict amplitudes,
                     __global double *rows, __global const double *restrict place, __global const double *restrict taper,
                     __global const double *restrict aperture) {
    size_t p = get_global_id(0), pixels = given.pixels, n_tiles = given.n_tiles, n = given.n;
    int stride = given.stride, origin = given.origin, vectors = given.vectors;
    rows += 2 * ((get_global_id(1) * given.n_used + p) * stride + origin);
    for (int r = get_global_id(1); r < given.n_run; r += get_global_size(1)) {
        __global const double *record = constants + (r * n + p) * N_CONST;
        int state = convert_int(record[C_STATE]);
        if (state == OUTSIDE || (BEAM && state == UNLIT)) continue;
        size_t k = given.first + r;
        for (size_t i = k * vectors; i < (k + 1) * vectors; i++) {
            point x = {LOAD(i, positions), LOAD(i, positions + pixels), LOAD(i, positions + 2 * pixels)};
            point q = {x.x - (dv)tile[k], x.y - (dv)tile[n_tiles + k], x.z - (dv)tile[2 * n_tiles + k]};
            dv qq = fma(q.x, q.x, fma(q.y, q.y, q.z * q.z));
            point_path at = path_of(record, pulse, n, p, state, x, q, qq);
            dv w[TAPS], sine, cosine, a = LOAD(i, amplitudes), b = LOAD(i, amplitudes + pixels);
            lv j;
            tap_weights(first_tap(at.t, at.base, stride, origin, &j), table, w);
            sincos_double(at.cycles, &sine, &cosine);
            dv re = fma(a, cosine, b * sine) * at.inside, im = fma(b, cosine, -a * sine) * at.inside;
            if (TAPERED) {
                dv weight = taper_weight(taper, ((dv)place[p] - LOAD(i, aperture)) * LOAD(i, aperture + pixels));
                re *= weight;
                im *= weight;
            }
            if (MATCHED) {
                pattern_value gain, unused;
                gains_of(at, taper, aperture + 18 * p, &gain, &unused);
                dv real = re;
                re = fma(gain.re, real, -gain.im * im);
                im = fma(gain.re, im, gain.im * real);
            }
            add_taps(rows, j, w, re, im);
        }
    }
}
