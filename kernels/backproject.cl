// Direct backprojection of range profiles onto tiles of pixels.
//
//   I(x) = sum_p v_p(x) s~_p(2 delta_p(x)/c) exp(+j 2 pi kappa_p delta_p(x)),   delta = half path - reference range
//
// source    the image equation of sarcl/__init__.py; Farooq 2009, section 2.2.2 (backprojection with FFT upsampling)
// symbols   delta, kappa as in geometry.clh;  s~_p  range profile, interpolated as in interp.clh
// macros    VW, FP64, BISTATIC, WRAP, BEAM, TAPS, TERMS, RANGE, ORDER as in the headers;  LOCAL as in tile_constants.cl
//           VECTORS   vectors of pixels per work-item
//           CHUNK     pulses added in float32 before they join the compensated total
//           WEIGHT    0 to 3: see pixel_weights.clh; GAINS, ALIKE and others as in gains.clh where it is 2 or 3
// reference: sarcl/reference/backproject.py:backproject

#define APART (VW == 1 && !BEAM && WEIGHT < 2)  // whole tiles inside of windows have code of their own
#if APART
#define IN_REGISTERS 1
#define RECORD const float *
#define SHIFTED (RANGE != 2)  // positions count from the middle between the taps: the shift is made once per pulse
#else
#define RECORD __global const float *restrict
#define SHIFTED 0
#endif
// The r-th vector of pixels of a work-item. With one lane, NEIGHBOURS items have neighbouring pixels, which read
// neighbouring samples; 32 items have pixels of four rows of a tile, so that few samples lie between them whether the
// range grows along a row or across.
#if VW == 1
#define VECTOR(r) ((get_global_id(0) / NEIGHBOURS * VECTORS + (r)) * NEIGHBOURS + get_global_id(0) % NEIGHBOURS)
#define NEIGHBOURS 8  // no tile has fewer work-items than 16
#else
#define VECTOR(r) (get_global_id(0) * VECTORS + (r))
#endif
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "pixel_weights.clh"
#if WEIGHT >= 2
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#endif

// Weights of a pulse in the pixels, as add_pulse takes them: its parameters, and the kernel's arguments.
#if WEIGHT == 1
#define WEIGHING_OF , float at_place, __global const float *restrict taper, const fv *from, const fv *inverse
#define WEIGHING , place[p], taper, from, inverse
#elif WEIGHT
#define WEIGHING_OF , float of_row, __global const float *restrict of_axes, __global const float *restrict patterns, int second
#define WEIGHING , row_weight[p], axes + 18 * (size_t)p, patterns, given.second
#else
#define WEIGHING_OF
#define WEIGHING
#endif

// Adds pulse p to the sums of VECTORS vectors of pixels; crossing: the tile may lie partly outside of its window or beam.
static inline void add_pulse(int crossing, RECORD record, __global const float *restrict pulse, int p, int n, const offset *x,
                             __global const float *restrict row, int stride, int origin, TABLE table, fv *re,
                             fv *im WEIGHING_OF) {
#pragma unroll
    for (int r = 0; r < VECTORS; r++) {
        phase_position at = locate(record, pulse, p, n, x[r]);
        fv v = 1;
        if (crossing) v = keep_inside(record, &at);
#if BEAM
        if (crossing) v *= in_beam(record, x[r]);
#endif
#if WEIGHT >= 2
        direction to_tx = load_direction(record, C_UX, C_LOW);
#if BISTATIC
        direction to_rx = load_direction(record, C_RX, C_RX_LOW);
#else
        direction to_rx = to_tx;
#endif
        fv tx_range, rx_range;
        triple away = toward(to_tx, x[r], &tx_range), back = toward(to_rx, x[r], &rx_range);
        antenna_view view = antenna_view_of(away, tx_range, back, rx_range, of_axes, 1.0f);
        complex_v gain = weight(view, patterns, second, 1.0f);
#endif
#if WEIGHT == 3
        re[r] = fma(v * (fv)of_row, fma(gain.re, gain.re, gain.im * gain.im), re[r]);
        continue;
#endif
        fv g, h, sine, cosine;
#if SHIFTED
        look_up_shifted(row, stride, origin, at.base, at.t, table, &g, &h);
#else
        look_up(row, stride, origin, at.base, at.t, table, &g, &h);
#endif
#if RANGE == 3
        sincos_sum(at.cycles, at.rest, &sine, &cosine);
#else
        sincos_cycles(at.cycles, &sine, &cosine);
#endif
        if (crossing) {
            g *= v;
            h *= v;
        }
#if WEIGHT == 1
        fv tapered = taper_weight(taper, ((fv)at_place - from[r]) * inverse[r]);
        g *= tapered;
        h *= tapered;
#elif WEIGHT == 2
        fv matched = fma(g, gain.re, h * gain.im);
        h = fma(h, gain.re, -g * gain.im);
        g = matched;
#endif
        re[r] = fma(g, cosine, fma(-h, sine, re[r]));
        im[r] = fma(g, sine, fma(h, cosine, im[r]));
    }
}

typedef struct {
    ulong pixels, local_offset;
    int stride, origin, n, n_used, n_tiles, first, n_offsets, offset_step, second;
    float magic;
} backproject_numbers;

// global size (work-items per tile, tiles of this block), local size (work-items per tile, 1)
//   profiles    (n, stride, 2)         complex range profiles; delay 0 stands at sample `origin`
//   table                              interpolation weights, see interp.clh
//   pulse       (2, N_PULSE, n)        see geometry.clh
//   constants   (tiles, n, N_CONST)    from tile_constants.cl
//   tile        (2, 3, n_tiles)        reference points, m about the scene's centre; this block starts at `first`
//   offsets     (planes, n_offsets)    m; tile k reads from vector k offset_step on (0: all tiles are alike)
//   used        n_used <= n            pulses that are real; the rest pads the vectors
//   image       (4, pixels)            totals re, im and their errors re, im; tiles in a row
//   skipped     (tiles)                pulses in whose window no pixel of the tile is; not used where LOCAL
//               BEAM: (2, tiles)       and those in whose window they are, but not in the beam
//   magic         1.5 2^23 times the step of the offsets' high parts, a power of two, m; where RANGE is 3
//   local_offset  complex number of `profiles` where the first tile's begin, where LOCAL
//   place         (n_used), taper (TAPER), aperture (2, pixels): start and inverse; where WEIGHT is 1
//   row_weight    (n_used), axes (n_used, 18), patterns, second: as in gains.clh; where WEIGHT is 2 or 3
__kernel void backproject(backproject_numbers given, __global const float *restrict profiles,
                          __global const float *restrict table, __global const float *restrict pulse,
                          __global const float *restrict constants, __global const float *restrict tile,
                          __global const float *restrict offsets, __global float *restrict image,
                          __global int *restrict skipped
#if WEIGHT == 1
                          , __global const float *restrict place, __global const float *restrict taper,
                          __global const float *restrict aperture
#elif WEIGHT
                          , __global const float *restrict row_weight, __global const float *restrict axes,
                          __global const float *restrict patterns
#endif
                          ) {
#if LOCAL
    profiles += 2 * (given.local_offset + (size_t)get_global_id(1) * given.n_used * given.stride);
#endif
    int n = given.n, n_used = given.n_used, stride = given.stride, origin = given.origin;
    int k = given.first + get_global_id(1), per_tile = get_global_size(0) * VECTORS;
    __global const float *c = constants + get_global_id(1) * (size_t)n * N_CONST;
    offset x[VECTORS];
#pragma unroll
    for (int r = 0; r < VECTORS; r++) {
        size_t at = (size_t)k * given.offset_step + VECTOR(r);
        x[r] = load_offset(offsets, at, given.n_offsets);
#if RANGE == 3
        split_offset(&x[r], offsets, at, given.n_offsets, given.magic);
#endif
        about_centre(&x[r], tile, k, given.n_tiles);
    }
#if WEIGHT == 1
    fv from[VECTORS], inverse[VECTORS];
#pragma unroll
    for (int r = 0; r < VECTORS; r++) {
        size_t i = (size_t)k * per_tile + VECTOR(r);
        from[r] = LOAD(i, aperture);
        inverse[r] = LOAD(i, aperture + given.pixels);
    }
#endif
#if APART
    float held[TAPS * TERMS];  // in registers: an instruction takes at most one operand of a kernel's arguments
#pragma unroll
    for (int i = 0; i < TAPS * TERMS; i++) held[i] = table[i];
#else
#define held table
#endif
    int missed = 0, unlit = 0;
    for (int start = 0; start < n_used; start += CHUNK) {
        fv re[VECTORS], im[VECTORS];
#pragma unroll
        for (int r = 0; r < VECTORS; r++) re[r] = im[r] = 0;
        int stop = min(start + CHUNK, n_used);
        for (int p = start; p < stop; p++) {
            __global const float *record = c + (size_t)p * N_CONST;
            int state = as_int(record[C_STATE]);
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
            __global const float *row = profiles + 2 * ((size_t)p * stride + origin);
#if APART
            float loaded[N_CONST];
#pragma unroll
            for (int i = 0; i < N_CONST; i += 4) vstore4(((__global const float4 *)record)[i / 4], 0, loaded + i);
#if SHIFTED
            loaded[C_FRAC] -= 0.5f * (TAPS - 1);
#endif
            // whole tiles take one of the two: those that lie inside of windows never look at each pixel
            if (state == INSIDE)
                add_pulse(0, loaded, pulse, p, n, x, row, stride, origin, held, re, im WEIGHING);
            else
                add_pulse(1, loaded, pulse, p, n, x, row, stride, origin, held, re, im WEIGHING);
#else
            add_pulse(state == CROSSING, record, pulse, p, n, x, row, stride, origin, held, re, im WEIGHING);
#endif
        }
#pragma unroll
        for (int r = 0; r < VECTORS; r++) {
            size_t i = (size_t)k * per_tile + VECTOR(r);
            add_compensated(image, image + 2 * given.pixels, i, re[r]);
            add_compensated(image + given.pixels, image + 3 * given.pixels, i, im[r]);
        }
    }
#if !LOCAL
    if (get_global_id(0) == 0) {
        skipped[k] += missed;
#if BEAM
        skipped[given.n_tiles + k] += unlit;
#endif
    }
#endif
}
