// Direct backprojection in float64, for tolerances below those of float32: ranges lose nothing at any distance.
//
//   I(x) = sum_p v_p(x) s~_p(2 delta_p(x)/c) exp(+j 2 pi kappa_p delta_p(x)),   delta = half path - reference range
//
// source    the image equation of sarcl/__init__.py
// symbols   delta, kappa as in point_path_float64.clh;  s~_p  range profile between its samples
// macros    VW, WRAP, TAPS, TERMS, BISTATIC, BEAM, ORDER as in the headers
//           WEIGHT    0 or 1: see pixel_weights.clh
//           TOWARDS   3: three images, whose rows are weighted by the mean of the unit vectors to T and R along x, y, z
//           CHUNK     pulses added plainly before they join the compensated total
// reference: sarcl/reference/backproject.py:backproject

#include "geometry_float64.clh"
#include "interp_float64.clh"
#include "point_path_float64.clh"
#include "pixel_weights.clh"

#define CHANNELS (TOWARDS ? 3 : 1)

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
            dv along[3] = {at.toward.x, at.toward.y, at.toward.z};
#pragma unroll
            for (int c = 0; c < CHANNELS; c++) {
                dv a = TOWARDS ? g * along[c] : g, b = TOWARDS ? h * along[c] : h;
                re[c] = fma(a, cosine, fma(-b, sine, re[c]));
                im[c] = fma(a, sine, fma(b, cosine, im[c]));
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
