// Gradients of Re <y, A x> by what each pulse has: phase, reference range, places and pointing of antennas, in float64.
//
//   z_p(x) = a(x) conj(b_p(x)),   b_p(x) = v_p(x) y~_p(t_p(x)) exp(+j 2 pi kappa_p delta_p(x)),   z'_p alike of j 2 pi kappa y
//   d/d phase = -sum_x Im(z G),   d/d reference range = -sum_x Re(z' G),   d/dT = sum_x Re(z' G e_T/2 + z dG/dT)
//   d/d rotation of the axes = sum_x Re(z dG/d rotation)
//
// One sum over points for each pulse, of what the image reads: nothing is spread.
//
// source    docs/theory/linear.md
// symbols   as in point_path_float64.clh, interp_float64.clh;  G of gains_float64.clh, 1 where WEIGHT is not 2;  y~  profile of y
// macros    VW, WRAP, TAPS, TERMS, BISTATIC, BEAM, ORDER, WEIGHT, GAINS, ALIKE as in the headers
// reference: sarcl/reference/linear.py:gradients

#include "geometry_float64.clh"
#include "interp_float64.clh"
#include "pixel_weights.clh"
#include "point_path_float64.clh"
#include "gains_float64.clh"

#define N_SUMS 11  // phase, reference range, then by T, by R and by rotations, three each

typedef struct {
    ulong pixels;
    int stride, origin, n, n_used, n_tiles, first, n_run, vectors;
} row_gradients_numbers;

static inline void add_point(dv *sums, dv s, point a) {
    sums[0] = fma(s, a.x, sums[0]);
    sums[1] = fma(s, a.y, sums[1]);
    sums[2] = fma(s, a.z, sums[2]);
}

// global size (n_used, splits): work-item (p, s) adds tiles s, s + splits, ... of this call to sums of pulse p
//   profiles, plain   of y times j 2 pi kappa, and of y, as in backproject_float64.cl, as all else that is not here
//   n_run, vectors, amplitudes   as in spread_float64.cl
//   sums   (splits, n_used, N_SUMS)   added to
__kernel void row_gradients(row_gradients_numbers given, __global const double *restrict profiles,
                            __global const double *restrict plain, __global const double *restrict table,
                            __global const double *restrict pulse, __global const double *restrict constants,
                            __global const double *restrict tile, __global const double *restrict positions,
                            __global const double *restrict amplitudes, __global double *restrict sums,
                            __global const double *restrict place, __global const double *restrict taper,
                            __global const double *restrict aperture) {
    size_t p = get_global_id(0), pixels = given.pixels, n_tiles = given.n_tiles, n = given.n;
    int stride = given.stride, origin = given.origin, vectors = given.vectors;
    size_t row = 2 * (p * stride + origin);
    dv total[N_SUMS] = {0};
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
            pattern_value sent, received;
            if (MATCHED) gains_of(at, taper, aperture + 18 * p, &sent, &received);  // before values that it needs no longer fill registers
            dv w[TAPS], sine, cosine, g, h, u, v, a = LOAD(i, amplitudes), b = LOAD(i, amplitudes + pixels);
            lv j;
            tap_weights(first_tap(at.t, at.base, stride, origin, &j), table, w);
            sincos_double(at.cycles, &sine, &cosine);
            weighted_sum(profiles + row, j, w, &g, &h);
            weighted_sum(plain + row, j, w, &u, &v);
            dv share = at.inside;
            if (TAPERED) share *= taper_weight(taper, ((dv)place[p] - LOAD(i, aperture)) * LOAD(i, aperture + pixels));
            // a exp(-j 2 pi cycles), times the conjugates of both profiles
            dv re = fma(a, cosine, b * sine) * share, im = fma(b, cosine, -a * sine) * share;
            dv z_re = fma(re, u, im * v), z_im = fma(im, u, -re * v), slope = fma(re, g, im * h), turn = z_im;
            if (MATCHED) {
                turn = fma(z_re, sent.im, z_im * sent.re);
                slope = fma(slope, sent.re, -fma(im, g, -re * h) * sent.im);
                add_point(total + 2, z_re, moved_tx(at, sent.slope_re));
                add_point(total + 2, -z_im, moved_tx(at, sent.slope_im));
                add_point(total + 5, z_re, moved_rx(at, received.slope_re));
                add_point(total + 5, -z_im, moved_rx(at, received.slope_im));
                add_point(total + 8, z_re, sum_of_points(sent.slope_re, received.slope_re));
                add_point(total + 8, -z_im, sum_of_points(sent.slope_im, received.slope_im));
            }
            total[0] -= turn;
            total[1] -= slope;
            add_point(total + 2, 0.5 * slope, at.to_tx);
            add_point(total + 5, 0.5 * slope, at.to_rx);
        }
    }
    sums += (get_global_id(1) * given.n_used + p) * N_SUMS;
#pragma unroll
    for (int m = 0; m < N_SUMS; m++) {
        double lane[VW];
        STORE(total[m], 0, lane);
        for (int l = 0; l < VW; l++) sums[m] += lane[l];
    }
}
