// Direct backprojection in float64, for tolerances below those of float32: ranges lose nothing at any distance.
//
//   I(x) = sum_p v_p(x) conj(g_p(x)) s~_p(2 delta_p(x)/c) exp(+j 2 pi kappa_p delta_p(x)),   delta = half path - reference range
//
// source    the image equation of sarcl/__init__.py
// symbols   delta, kappa as in point_path_float64.clh;  s~_p  range profile between its samples
// macros    VW, WRAP, TAPS, TERMS, BISTATIC, BEAM, ORDER as in the headers
//           WEIGHT    0 to 3: see pixel_weights.clh;  GAINS, ALIKE as in gains_float64.clh, where it is 2 or 3
//           GRADIENT  1: the gradient of <y, A x> by positions over amplitudes, conjugate: three images of y times j 2 pi kappa,
//                     weighted by minus the mean of the unit vectors to T and R, and of y times the gradient of the gains
//           CHUNK     pulses added plainly before they join the compensated total
// reference: sarcl/reference/backproject.py:backproject

#ifndef GRADIENT
#define GRADIENT 0
#endif
#include "geometry_float64.clh"
#include "interp_float64.clh"
#include "pixel_weights.clh"
#include "point_path_float64.clh"
#include "gains_float64.clh"

#define CHANNELS (GRADIENT ? 3 : 1)

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
//   image       (CHANNELS, 4, pixels) totals re, im and their errors re, im
//   place       (n_used), taper (TAPER), aperture (2, pixels): start and inverse; not read where WEIGHT is 0. Where it is 2
//               or 3 taper has the patterns, and aperture the axes (n_used, 18); where it is 3 place has the weights of rows
//   skipped     (2, n_tiles)          pulses in whose window no point of the tile lies, and those in whose beam none does
//   plain       as profiles, which are those of y times j 2 pi kappa: of y itself. Read where there are gains and GRADIENT
__kernel void backproject(backproject_numbers given, __global const double *restrict profiles,
                          __global const double *restrict table, __global const double *restrict pulse,
                          __global const double *restrict constants, __global const double *restrict tile,
                          __global const double *restrict positions, __global double *restrict image,
                          __global int *restrict skipped, __global const double *restrict place,
                          __global const double *restrict taper, __global const double *restrict aperture, __global const double *restrict plain) {
    size_t k = given.first + get_global_id(1), i = k * get_global_size(0) + get_global_id(0), pixels = given.pixels;
    int n = given.n, n_used = given.n_used, n_tiles = given.n_tiles, stride = given.stride, origin = given.origin;
    __global const double *record = constants + get_global_id(1) * (size_t)n * N_CONST;
    point x = {LOAD(i, positions), LOAD(i, positions + pixels), LOAD(i, positions + 2 * pixels)};
    point q = {x.x - (dv)tile[k], x.y - (dv)tile[n_tiles + k], x.z - (dv)tile[2 * (size_t)n_tiles + k]};
    dv qq = fma(q.x, q.x, fma(q.y, q.y, q.z * q.z));
    int missed = 0, unlit = 0;
    for (int start = 0; start < n_used; start += CHUNK) {
        dv re[CHANNELS] = {0}, im[CHANNELS] = {0};
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
            point_path at = path_of(record, pulse, n, p, state, x, q, qq);
            pattern_value sent, received;
            if (SUMS_GAINS) {
                gains_of(at, taper, aperture + 18 * (size_t)p, &sent, &received);
                re[0] = fma(place[p] * at.inside, fma(sent.re, sent.re, sent.im * sent.im), re[0]);
                continue;
            }
            dv w[TAPS], g, h, sine, cosine;
            lv j;
            tap_weights(first_tap(at.t, at.base, stride, origin, &j), table, w);
            weighted_sum(profiles + 2 * ((size_t)p * stride + origin), j, w, &g, &h);
            sincos_double(at.cycles, &sine, &cosine);
            if (state == CROSSING) {
                g *= at.inside;
                h *= at.inside;
            }
            if (TAPERED) {
                dv weight = taper_weight(taper, ((dv)place[p] - LOAD(i, aperture)) * LOAD(i, aperture + pixels));
                g *= weight;
                h *= weight;
            }
            dv a = fma(g, cosine, -h * sine), b = fma(g, sine, h * cosine);
            if (MATCHED) {
                gains_of(at, taper, aperture + 18 * (size_t)p, &sent, &received);
                dv real = a;
                a = fma(sent.re, real, sent.im * b);
                b = fma(sent.re, b, -sent.im * real);
            }
            if (!GRADIENT) {
                re[0] += a;
                im[0] += b;
                continue;
            }
            point e = times((dv)-0.5, sum_of_points(at.to_tx, at.to_rx));
            dv along[3] = {e.x, e.y, e.z};
#pragma unroll
            for (int c = 0; c < CHANNELS; c++) {
                re[c] = fma(a, along[c], re[c]);
                im[c] = fma(b, along[c], im[c]);
            }
            if (MATCHED) {
                weighted_sum(plain + 2 * ((size_t)p * stride + origin), j, w, &g, &h);
                a = fma(g, cosine, -h * sine) * at.inside;
                b = fma(g, sine, h * cosine) * at.inside;
                point x_re = moved_both(at, sent.slope_re, received.slope_re), x_im = moved_both(at, sent.slope_im, received.slope_im);
                dv real[3] = {x_re.x, x_re.y, x_re.z}, imaginary[3] = {x_im.x, x_im.y, x_im.z};
#pragma unroll
                for (int c = 0; c < CHANNELS; c++) {
                    re[c] -= fma(real[c], a, imaginary[c] * b);
                    im[c] -= fma(real[c], b, -imaginary[c] * a);
                }
            }
        }
        for (int c = 0; c < CHANNELS; c++) {
            __global double *sums = image + 4 * c * pixels;
            add_compensated(sums, sums + 2 * pixels, i, re[c]);
            add_compensated(sums + pixels, sums + 3 * pixels, i, im[c]);
        }
    }
    if (get_global_id(0) == 0) {
        skipped[k] += missed;
        skipped[n_tiles + k] += unlit;
    }
}
