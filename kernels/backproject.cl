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
#define SHIFTED (APART && RANGE != 2)  // positions count from the middle between the taps: the shift is made once per pulse
#if APART
#define IN_REGISTERS 1
#define RECORD const float *
#endif
// The r-th vector of pixels of a work-item. With one lane, NEIGHBOURS items have neighbouring pixels, which read
// neighbouring samples; 32 items have pixels of four rows of a tile, so that few samples lie between them whether the
// range grows along a row or across.
#define NEIGHBOURS (VW == 1 ? 8 : 1)  // no tile has fewer work-items than 16 with one lane
#define VECTOR(r) ((get_global_id(0) / NEIGHBOURS * VECTORS + (r)) * NEIGHBOURS + get_global_id(0) % NEIGHBOURS)
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "range_phase.clh"
#include "vec3_complex.clh"
#include "pixel_weights.clh"
#include "pixel_gain.clh"

// A vector of pixels; where they are tapered, start and inverse length of their apertures.
typedef struct {
    tile_point point;
    fv start, inverse;
} pixel_vector;

// Adds pulse p to the sums of VECTORS vectors of pixels; crossing: the tile may lie partly outside of its window or beam.
// row: profile of the pulse, at its sample of delay 0.
static inline void add_pulse(int crossing, RECORD record, __global const float *restrict pulse, int p, int n,
                             const pixel_vector *pixels, __global const float *restrict row, int stride, int origin,
                             TABLE table, pulse_weight weights, fv *re, fv *im) {
#pragma unroll
    for (int r = 0; r < VECTORS; r++) {
        phase_position at = locate(record, pulse, p, n, pixels[r].point);
        fv v = 1, g, h, sine, cosine;
        if (crossing) v = keep_inside(record, &at);
        if (BEAM && crossing) v *= in_beam(record, pixels[r].point.near);
        complex_v gain = pixel_gain(weights, record, pixels[r].point.near);
        if (SUMS_GAINS) {
            re[r] = fma(v * (fv)weights.of_pulse, fma(gain.re, gain.re, gain.im * gain.im), re[r]);
            continue;
        }
        if (SHIFTED) look_up_shifted(row, stride, origin, at.base, at.t, table, &g, &h);
        else look_up(row, stride, origin, at.base, at.t, table, &g, &h);
        carrier(at, &sine, &cosine);
        if (crossing) {
            g *= v;
            h *= v;
        }
        if (TAPERED) {
            fv taper = taper_weight(weights.table, ((fv)weights.of_pulse - pixels[r].start) * pixels[r].inverse);
            g *= taper;
            h *= taper;
        }
        if (MATCHED) {
            fv matched = fma(g, gain.re, h * gain.im);
            h = fma(h, gain.re, -g * gain.im);
            g = matched;
        }
        re[r] = fma(g, cosine, fma(-h, sine, re[r]));
        im[r] = fma(g, sine, fma(h, cosine, im[r]));
    }
}

#if APART
// Table of the taps, and the record of a tile and pulse, in registers: an instruction takes at most one operand of a
// kernel's arguments.
typedef struct {
    float of[TAPS * TERMS];
} held_table;
typedef struct {
    float of[N_CONST];
} held_record;
#define HELD(numbers) (numbers).of

static inline void hold_table(held_table *held, __global const float *restrict table) {
#pragma unroll
    for (int i = 0; i < TAPS * TERMS; i++) held->of[i] = table[i];
}

static inline void hold_record(held_record *held, __global const float *restrict record) {
#pragma unroll
    for (int i = 0; i < N_CONST; i += 4) vstore4(((__global const float4 *)record)[i / 4], 0, held->of + i);
    if (SHIFTED) held->of[C_FRAC] -= 0.5f * (TAPS - 1);
}
#else
typedef __global const float *held_table;
typedef __global const float *held_record;
#define HELD(numbers) (numbers)
static inline void hold_table(held_table *held, __global const float *restrict table) { *held = table; }
static inline void hold_record(held_record *held, __global const float *restrict record) { *held = record; }
#endif

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
//   pulse_weights, weight_table, weight_geometry, second   of pixel_weights.clh; not read where WEIGHT is 0
__kernel void backproject(backproject_numbers given, __global const float *restrict profiles,
                          __global const float *restrict table, __global const float *restrict pulse,
                          __global const float *restrict constants, __global const float *restrict tile,
                          __global const float *restrict offsets, __global float *restrict image,
                          __global int *restrict skipped, __global const float *restrict pulse_weights,
                          __global const float *restrict weight_table, __global const float *restrict weight_geometry) {
    int n = given.n, n_used = given.n_used, stride = given.stride, origin = given.origin;
    int k = given.first + get_global_id(1), per_tile = get_global_size(0) * VECTORS;
    __global const float *c = constants + get_global_id(1) * (size_t)n * N_CONST;
    if (LOCAL) profiles += 2 * (given.local_offset + (size_t)get_global_id(1) * n_used * stride);
    pixel_vector pixels[VECTORS];
#pragma unroll
    for (int r = 0; r < VECTORS; r++) {
        size_t at = (size_t)k * given.offset_step + VECTOR(r), i = (size_t)k * per_tile + VECTOR(r);
        pixels[r].point = load_tile_point(offsets, at, given.n_offsets, tile, k, given.n_tiles, given.magic);
        if (TAPERED) {
            pixels[r].start = LOAD(i, weight_geometry);
            pixels[r].inverse = LOAD(i, weight_geometry + given.pixels);
        }
    }
    held_table taps;
    hold_table(&taps, table);
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
            if (BEAM && state == UNLIT) {
                unlit++;
                continue;
            }
            __global const float *row = profiles + 2 * ((size_t)p * stride + origin);
            pulse_weight weights = weight_of_pulse(p, pulse_weights, weight_table, weight_geometry, given.second);
            held_record held;
            hold_record(&held, record);
            // whole tiles take one of the two: those that lie inside of windows never look at each pixel
            if (APART && state == INSIDE)
                add_pulse(0, HELD(held), pulse, p, n, pixels, row, stride, origin, HELD(taps), weights, re, im);
            else
                add_pulse(APART || state == CROSSING, HELD(held), pulse, p, n, pixels, row, stride, origin, HELD(taps), weights,
                          re, im);
        }
#pragma unroll
        for (int r = 0; r < VECTORS; r++) {
            size_t i = (size_t)k * per_tile + VECTOR(r);
            add_compensated(image, image + 2 * given.pixels, i, re[r]);
            add_compensated(image + given.pixels, image + 3 * given.pixels, i, im[r]);
        }
    }
    if (!LOCAL && get_global_id(0) == 0) {
        skipped[k] += missed;
        if (BEAM) skipped[given.n_tiles + k] += unlit;
    }
}
