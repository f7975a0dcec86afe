// Direct backprojection onto square tiles of a plane, a line of pixels at a time: no gather, sine or cosine per pixel.
//
//   Along a line of pixels the range grows by the same step, so all pixels of the line lie between the samples of a
//   profile taken at that step, at one and the same fraction. For every (tile, pulse) such a profile is made once,
//   carrier included; a pixel then costs LINE_TAPS complex products with weights that its whole line shares.
//
//   delta(i, j) = A_i + j beta + rest_ij,    I_ij += sum_b W_b(i) T(n_i + b + FINE j),
//   T(m) = s~(m beta/FINE) exp(+j 2 pi kappa m beta/FINE),    W_b(i) = w_b(z_i) exp(+j 2 pi kappa (A_i - (n_i + b) beta/FINE))
//
// source    the image equation of sarcl/__init__.py. The part of the curvature that is not in A_i, rest_ij, is that of the pulse in
//           the middle of a group of pulses; a pulse whose own differs by more than limit_cycles cycles, whose position differs
//           by more than limit_position samples or whose step is more than limit_step samples per pixel is added pixel by
//           pixel instead, as are window edges: the planned error holds for every pulse.
// symbols   i, j      line, and pixel in the line, about the tile's reference pixel (SIDE/2, SIDE/2); the lines are rows of the
//                     image, or its columns where `transposed`
//           A_i       half path of the middle of line i, with the constant part of its curvature, m
//           beta      half path that a pixel along the line adds, m
//           n_i, z_i  first sample of T for line i, and where A_i lies between samples; w_b weights, interp.clh's table form
//           q         square of a pixel's offset from the reference pixel, m^2
//           u, R0, a, w   as in tile_paths.clh
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, ORDER, BEAM as in the headers
//           SIDE      of a tile, a multiple of VW;  FINE samples of T per pixel (1, 2, 4 or 8)
//           LINE_TAPS even; LINE_TERMS;  GROUP  most pulses of a group: those that fit into local memory
//           SLOPE     1: sums of dT/dm too, so that rest_ij moves each pixel's position as well as its phase
// reference: sarcl/reference/backproject.py:backproject

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "line_geometry.clh"
#include "line_group.clh"

#define VECS (SIDE / VW)
#define PARTS (SLOPE ? 4 : 2)       // of a weight: re, im, and of its slope
#define MOST (2 * SIDE + 2 * VW)    // samples of T per FINE-th phase
// of one pulse, in local memory: T[FINE][re, im][MOST], W[LINE_TAPS][PARTS][SIDE], at[SIDE][LINE_TAPS]
#define T_SIZE (FINE * 2 * MOST)
#define W_SIZE (LINE_TAPS * PARTS * SIDE)
#define AT_SIZE (SIDE * LINE_TAPS)

DEFINE_WEIGHTS(line_weights, LINE_TAPS, LINE_TERMS)
DEFINE_SLOPES(line_slopes, LINE_TAPS, LINE_TERMS)

// The lanes' numbers.
#define LANES_1 0
#define LANES_8 (float8)(0, 1, 2, 3, 4, 5, 6, 7)
#define LANES_16 (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
static inline fv lanes(void) { return CAT(LANES_, VW); }

// Weights W_b(i) of all lines of a pulse, and n_i; 0 where the samples of a line lie too far off to be stored, as for a
// steep line, or have no spacing, as where the range is the same along a line.
INLINED int weigh_lines(group pulses, line_geometry line, __global const float *restrict weights, __local float *W, iv *n_i) {
    if (fabs(line.along) < LEAST_STEP) return 0;
    fv lane = lanes();
    float samples_of_T = FINE / line.along, farthest = 0;  // samples of T per sample of the profile
    for (int v = 0; v < VECS; v++) {
        fv i = lane + (fv)(v * VW - SIDE / 2), none = 0, end = (fv)(SIDE / 2);
        fv centre = curvature_at(line, i, none, q_of_line(pulses, i)), q = q_of(pulses, i, end);
        fv in_position = 0.25f * (curvature_at(line, i, end, q) + curvature_at(line, i, -end, q)) + (fv)0.5f * centre;
        fv position = fma(in_position, (fv)line.sigma, i * line.across);
        fv t = position * samples_of_T - (fv)(0.5f * (LINE_TAPS - 1)), first = nearest(t), z = t - first;
        farthest = fmax(farthest, largest(fabs(t)));
        n_i[v] = nearest_int(t);
        fv weight[LINE_TAPS], slope[LINE_TAPS];
        line_weights(z, weights, weight);
        if (SLOPE) line_slopes(z, weights, slope);
        fv cycles = fma(centre, (fv)line.kappa, cycles_of(i, line.cycles_across, line.cycles_across_low) + line.cycles);
        cycles -= nearest(cycles);
        cycles -= cycles_of(first, line.fine_cycles, line.fine_cycles_low);
        cycles -= nearest(cycles);
#pragma unroll
        for (int b = 0; b < LINE_TAPS; b++) {
            fv of_tap = cycles - (fv)(b * line.fine_cycles), sine, cosine;
            of_tap = of_tap - (fv)(b * line.fine_cycles_low);
            of_tap -= nearest(of_tap);
            sincos_cycles(of_tap, &sine, &cosine);
            STORE(weight[b] * cosine, v, W + PARTS * b * SIDE);
            STORE(weight[b] * sine, v, W + (PARTS * b + 1) * SIDE);
            if (SLOPE) {
                fv per_metre = slope[b] * (samples_of_T * line.sigma);
                STORE(per_metre * cosine, v, W + (PARTS * b + 2) * SIDE);
                STORE(per_metre * sine, v, W + (PARTS * b + 3) * SIDE);
            }
        }
    }
    return farthest <= (float)(FINE * (SIDE / 2 + VW) - LINE_TAPS);
}

// T of a pulse: its profile at the step of a line, carrier included. Sample FINE k + a is stored at T[a][k - from].
INLINED void take_samples(line_geometry line, __global const float *restrict row, int stride, int origin,
                                __global const float *restrict table, int from, int vectors, __local float *T) {
    fv lane = lanes();
    for (int a = 0; a < FINE; a++)
        for (int v = 0; v < vectors; v++) {
            fv m = (lane + (fv)(v * VW + from)) * (fv)FINE + (fv)a, re, im, sine, cosine;
            fv t = fma(m, (fv)(line.along * (1.0f / FINE)), (fv)line.frac);
            look_up(row, stride, origin, (iv)line.base, t, table, &re, &im);
            sincos_cycles(cycles_of(m, line.fine_cycles, line.fine_cycles_low), &sine, &cosine);
            STORE(fma(re, cosine, -im * sine), v, T + 2 * a * MOST);
            STORE(fma(re, sine, im * cosine), v, T + (2 * a + 1) * MOST);
        }
}

// Makes T, W and the positions `at` of a pulse, number `made` of its group; 0 where the pulse must be added pixel by pixel.
INLINED int make_lines(group pulses, line_geometry line, int made, __global const float *restrict row, int stride, int origin,
                             __global const float *restrict table, __global const float *restrict weights, float limit_cycles,
                             float limit_position, float limit_step, __local float *T, __local float *W, __local int *at) {
    iv n_i[VECS];
    if (!(fabs(line.along) <= limit_step) || !fits(pulses, line, limit_cycles, limit_position)) return 0;
    if (!weigh_lines(pulses, line, weights, W + made * W_SIZE, n_i)) return 0;
    int lowest = 1 << 20, highest = -(1 << 20);
    for (int r = 0; r < SIDE; r++) {
        lowest = min(lowest, ((int *)n_i)[r]);
        highest = max(highest, ((int *)n_i)[r]);
    }
    int from = (lowest >> FINE_BITS) - SIDE / 2;
    int vectors = (((highest + LINE_TAPS - 1) >> FINE_BITS) + SIDE / 2 - from + VW) / VW;
    for (int r = 0; r < SIDE; r++) {
#pragma unroll
        for (int b = 0; b < LINE_TAPS; b++) {
            int m = ((int *)n_i)[r] + b;
            at[made * AT_SIZE + r * LINE_TAPS + b] =
                made * T_SIZE + (m & (FINE - 1)) * 2 * MOST + (m >> FINE_BITS) - SIDE / 2 - from;
        }
    }
    take_samples(line, row, stride, origin, table, from, vectors, T + made * T_SIZE);
    return 1;
}

// Sums are scalars made by macros, one for each of SUMS vectors: arrays stay in memory, which costs twice the time.
#if VECS >= 4
#define SUMS 4
#define EACH(what) what(0) what(1) what(2) what(3)
#elif VECS == 2
#define SUMS 2
#define EACH(what) what(0) what(1)
#else
#define SUMS 1
#define EACH(what) what(0)
#endif
#define BEGIN(v) fv re##v = 0, im##v = 0, slope_re##v = 0, slope_im##v = 0;
#define ADD(v)                                                                      \
    {                                                                               \
        fv t_re = LOAD(v, t), t_im = LOAD(v, t + MOST);                              \
        re##v = fma(t_re, w_re, fma(-t_im, w_im, re##v));                           \
        im##v = fma(t_re, w_im, fma(t_im, w_re, im##v));                            \
        if (SLOPE) {                                                                \
            slope_re##v = fma(t_re, dw_re, fma(-t_im, dw_im, slope_re##v));         \
            slope_im##v = fma(t_re, dw_im, fma(t_im, dw_re, slope_im##v));          \
        }                                                                           \
    }
#define END(v) re[v] = re##v, im[v] = im##v, slope_re[v] = slope_re##v, slope_im[v] = slope_im##v;

// SUMS vectors of pixels of line r from pixel j0 on, both counted from 0: the `made` pulses of the group, then the rest_ij
// that they share.
INLINED void sum_line(group pulses, int r, int j0, int made, __local const float *T, __local const float *W,
                            __local const int *at, fv *re, fv *im) {
    fv slope_re[SUMS], slope_im[SUMS];
    EACH(BEGIN)
    for (int p = 0; p < made; p++) {
        __local const float *w = W + p * W_SIZE + r;
        __local const int *at_line = at + p * AT_SIZE + r * LINE_TAPS;
#pragma unroll
        for (int b = 0; b < LINE_TAPS; b++) {
            fv w_re = (fv)w[PARTS * b * SIDE], w_im = (fv)w[(PARTS * b + 1) * SIDE], dw_re = 0, dw_im = 0;
            if (SLOPE) {
                dw_re = (fv)w[(PARTS * b + 2) * SIDE];
                dw_im = (fv)w[(PARTS * b + 3) * SIDE];
            }
            __local const float *t = T + at_line[b] + j0;
            EACH(ADD)
        }
    }
    EACH(END)
    line_geometry line = pulses.middle;
    fv i = (fv)(r - SIDE / 2), none = 0, centre = curvature_at(line, i, none, q_of_line(pulses, i));
    fv end = (fv)(SIDE / 2), q_end = q_of(pulses, i, end);
    fv in_position = 0.25f * (curvature_at(line, i, end, q_end) + curvature_at(line, i, -end, q_end)) - (fv)0.5f * centre;
#pragma unroll
    for (int v = 0; v < SUMS; v++) {
        fv j = lanes() + (fv)(j0 + v * VW - SIDE / 2), sine, cosine;
        fv rest = curvature_at(line, i, j, q_of(pulses, i, j)) - centre, cycles = rest * line.kappa;
        if (SLOPE) {
            re[v] = fma(slope_re[v], rest - in_position, re[v]);
            im[v] = fma(slope_im[v], rest - in_position, im[v]);
        }
        sincos_cycles(cycles - nearest(cycles), &sine, &cosine);
        fv rotated = fma(re[v], cosine, -im[v] * sine);
        im[v] = fma(re[v], sine, im[v] * cosine);
        re[v] = rotated;
    }
}

// total[i], total[i + step], ... += x, as add_compensated
INLINED void add_with_step(__global float *total, __global float *error, size_t i, int step, fv x) {
    float hi[VW], lo[VW];
#pragma unroll
    for (int l = 0; l < VW; l++) hi[l] = total[i + l * step];
    pair sum = exact_sum(LOAD(0, hi), x);
    STORE(sum.hi, 0, hi);
    STORE(sum.lo, 0, lo);
#pragma unroll
    for (int l = 0; l < VW; l++) {
        total[i + l * step] = hi[l];
        error[i + l * step] += lo[l];
    }
}

typedef struct {
    ulong pixels, local_offset;
    int stride, origin, n, n_used, first, n_tiles, group_size, own_profiles;
    float step_x, step_y, limit_cycles, limit_position, limit_step;
} backproject_lines_numbers;

// global size (tiles of this block), local size 1. Arguments as of `backproject`; step_x, step_y: m per pixel along j and
// i; weights: of LINE_TAPS taps; skipped (n_tiles), BEAM: (2, n_tiles)
//   group_size     pulses of a group, at most GROUP
//   own_profiles   1: every tile has profiles of its own, about its reference pixel (factorised); 0: pulses' own
__kernel void backproject_lines(backproject_lines_numbers given, __global const float *restrict profiles,
                                __global const float *restrict table, __global const float *restrict weights,
                                __global const float *restrict constants, __global float *restrict image,
                                __global int *restrict skipped) {
    __local float T[GROUP * T_SIZE];
    __local float W[GROUP * W_SIZE];
    __local int at[GROUP * AT_SIZE];
    int tile = given.first + get_global_id(0), missed = 0, unlit = 0;
    int n_used = given.n_used, stride = given.stride, origin = given.origin;
    size_t pixels = given.pixels;
    if (given.own_profiles) profiles += 2 * (given.local_offset + (size_t)get_global_id(0) * n_used * stride);
    profiles += 2 * origin;
    __global const float *records = constants + get_global_id(0) * (size_t)given.n * N_LINE;
    for (int start = 0; start < n_used; start += given.group_size) {
        int by_lines[GROUP], by_pixels[GROUP], n_lines = 0, n_pixels = 0, made = 0;  // pulses
        for (int p = start; p < min(start + given.group_size, n_used); p++) {
            int state = as_int(records[(size_t)p * N_LINE + L_STATE]);
            if (state == OUTSIDE) missed++;
            else if (state == UNLIT) unlit++;
            else if (state == INSIDE) by_lines[n_lines++] = p;
            else by_pixels[n_pixels++] = p;
        }
        if (n_lines + n_pixels == 0) continue;
        __global const float *middle = records + (size_t)(n_lines ? by_lines[n_lines / 2] : by_pixels[0]) * N_LINE;
        group pulses = group_of(middle, given.step_x, given.step_y);

        for (int f = 0; f < n_lines; f++) {
            line_geometry line = load_line(records + (size_t)by_lines[f] * N_LINE, pulses.transposed);
            __global const float *row = profiles + 2 * (size_t)by_lines[f] * stride;
            if (make_lines(pulses, line, made, row, stride, origin, table, weights, given.limit_cycles, given.limit_position,
                           given.limit_step, T, W, at))
                made++;
            else
                by_pixels[n_pixels++] = by_lines[f];
        }
        for (int r = 0; r < SIDE; r++)
            for (int j0 = 0; j0 < SIDE; j0 += SUMS * VW) {
                fv re[SUMS], im[SUMS];
                sum_line(pulses, r, j0, made, T, W, at, re, im);
                if (n_pixels) {  // arrays of their own let this be a loop, whose code is built once, beside sums in registers
                    fv of_pixels_re[SUMS], of_pixels_im[SUMS];
#pragma unroll
                    for (int v = 0; v < SUMS; v++) of_pixels_re[v] = re[v], of_pixels_im[v] = im[v];
#pragma unroll 1
                    for (int v = 0; v < SUMS; v++)
                        for (int f = 0; f < n_pixels; f++)
                            add_pixels(pulses, records + (size_t)by_pixels[f] * N_LINE, (fv)(r - SIDE / 2),
                                       lanes() + (fv)(j0 + v * VW - SIDE / 2), profiles + 2 * (size_t)by_pixels[f] * stride,
                                       stride, origin, table, &of_pixels_re[v], &of_pixels_im[v]);
#pragma unroll
                    for (int v = 0; v < SUMS; v++) re[v] = of_pixels_re[v], im[v] = of_pixels_im[v];
                }
#pragma unroll
                for (int v = 0; v < SUMS; v++) {
                    int j = j0 + v * VW;
                    size_t pixel = (size_t)tile * (SIDE * SIDE) + (pulses.transposed ? j * SIDE + r : r * SIDE + j);
                    if (pulses.transposed) {
                        add_with_step(image, image + 2 * pixels, pixel, SIDE, re[v]);
                        add_with_step(image + pixels, image + 3 * pixels, pixel, SIDE, im[v]);
                    } else {
                        add_compensated(image, image + 2 * pixels, pixel / VW, re[v]);
                        add_compensated(image + pixels, image + 3 * pixels, pixel / VW, im[v]);
                    }
                }
            }
    }
    if (given.own_profiles) return;
    skipped[tile] += missed;
    if (BEAM) skipped[given.n_tiles + tile] += unlit;
}
