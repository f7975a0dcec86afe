// Direct backprojection onto square tiles of a plane, a line of pixels at a time, shared by a work-group: the sums of
// backproject_lines.cl for devices with one lane per work-item (GPUs).
//
//   delta(i, j) = A_i + j beta + rest_ij,    I_ij += sum_b W_b(i) T(n_i + b + FINE j)
//
// A work-group adds up a tile, or its part of the pulses. For each pulse its items make T and the weights of all lines in local
// memory, then each item adds LINE_TAPS products to each of its pixels, which stay in registers: no gather, sine, cosine or
// wide number per pixel.
//
// source    backproject_lines.cl, also for pulses that are added pixel by pixel. The sums are kept without the rest_ij of a
//           group of pulses, that of its middle pulse: where groups change, and after CHUNK pulses, sums are turned by the
//           difference of the phases
// symbols   T, W, n_i, rest_ij, beta   as in backproject_lines.cl
// macros    FP64, BISTATIC, WRAP, TAPS, TERMS, ORDER, BEAM, SIDE, FINE, LINE_TAPS, LINE_TERMS, GROUP as in
//           backproject_lines.cl;  SHARED 1, see line_geometry.clh
//           ITEMS     work-items of a group;  CHUNK  pulses added in float32 before they join the compensated total
//           REGISTERS  most registers of a work-item, which the driver is told instead of ITEMS (device.py); 0: it is told ITEMS
//           SLOPE_TAPS, SLOPE_TERMS  of the slopes of the weights, by which rest_ij moves each pixel's position; 0: none
// reference: sarcl/reference/backproject.py:backproject

#undef VW
#define VW 1
#define BY_VALUE 1
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "line_geometry.clh"
#include "line_group.clh"
#include "line_schedule.clh"

#define PIXELS 4                  // neighbouring pixels of a line that belong to a work-item
#define ACROSS (SIDE / PIXELS)    // work-items that share a line
#define AT_ONCE (ITEMS / ACROSS)  // lines that the work-group adds to at a time
#define LINES (SIDE / AT_ONCE)    // lines that a work-item adds to, every AT_ONCE-th
// 1: samples of a profile are loaded before the sums, which pass while memory answers. Sums of slopes leave no registers for
// that: on an H100 it gains 7 % without them, and loses 5 % with them against half as many registers.
#define AHEAD (SLOPE_TAPS == 0)
#if REGISTERS
#define GROUP_SIZE work_group_size_hint(ITEMS, 1, 1)
#else
#define GROUP_SIZE reqd_work_group_size(ITEMS, 1, 1)
#endif
#define WEIGHING (ITEMS < SIDE ? ITEMS : SIDE)  // the last work-items, which make the weights of lines

#include "pulse_lines.clh"

// The sums of a work-item, without the rest_ij of the pulses so far.
typedef struct {
    float re[LINES][PIXELS], im[LINES][PIXELS];
#if SLOPE_TAPS
    float slope_re[LINES][PIXELS], slope_im[LINES][PIXELS];
#endif
} sums;

#define CLEAR(what)                                 \
    _Pragma("unroll") for (int l = 0; l < LINES; l++) \
        _Pragma("unroll") for (int c = 0; c < PIXELS; c++) what[l][c] = 0;

// Adds one pulse to a work-item's pixels: `lane` counts items along a line, `r0` is the first line.
INLINED void sum_lines(sums *s, int r0, int lane, __local const pulse_lines *made) {
#pragma unroll
    for (int l = 0; l < LINES; l++) {
        int r = r0 + l * AT_ONCE;
        __local const float2 *t = made->T + made->at[r] + lane;
        float2 w[LINE_TAPS];
#pragma unroll
        for (int b = 0; b < LINE_TAPS; b += 2) {
            float4 two = made->W[r * (LINE_TAPS / 2) + b / 2];
            w[b] = two.xy;
            w[b + 1] = two.zw;
        }
#if SLOPE_TAPS
        float2 v[SLOPE_TAPS];
#pragma unroll
        for (int b = 0; b < SLOPE_TAPS; b += 2) {
            float4 two = made->V[r * (SLOPE_TAPS / 2) + b / 2];
            v[b] = two.xy;
            v[b + 1] = two.zw;
        }
#endif
#pragma unroll
        for (int k = 0; k < READ; k++) {
            float2 u = t[k * COLUMNS];
#pragma unroll
            for (int c = 0; c < PIXELS; c++) {
                int b = k - FINE * c;
                if (b < 0 || b >= LINE_TAPS) continue;
                s->re[l][c] = fma(u.x, w[b].x, fma(-u.y, w[b].y, s->re[l][c]));
                s->im[l][c] = fma(u.x, w[b].y, fma(u.y, w[b].x, s->im[l][c]));
#if SLOPE_TAPS
                b -= OUTER;
                if (b < 0 || b >= SLOPE_TAPS) continue;
                s->slope_re[l][c] = fma(u.x, v[b].x, fma(-u.y, v[b].y, s->slope_re[l][c]));
                s->slope_im[l][c] = fma(u.x, v[b].y, fma(u.y, v[b].x, s->slope_im[l][c]));
#endif
            }
        }
    }
}

// Where the sums of a tile go: image as of the kernel, from its first pixel on.
typedef struct {
    __global float *image;
    ulong pixels;
    int transposed;
} place;

// Gives the sums the rest_ij of the pulses so far, whose middle pulse is `from`. With `to`, the middle pulse of the next
// ones, that one's rest_ij is taken from them; without, they are added to the image and begin anew.
INLINED void turn(sums *s, __global const float *restrict from, __global const float *restrict to, float step_x,
                        float step_y, int r0, int lane, place out) {
    group now = group_of(from, step_x, step_y), next = now;
    if (to) next.middle = load_line(to, now.transposed);
    // the lines take turns in the registers of the first, which a loop can name
#pragma unroll 1
    for (int r = r0; r < r0 + SIDE; r += AT_ONCE) {
        float i = r - SIDE / 2, q_line = q_of_line(now, i);
        float centre = curvature_at(now.middle, i, 0, q_line), centre_next = curvature_at(next.middle, i, 0, q_line);
#if SLOPE_TAPS
        float shift = in_position_of(now, now.middle, i, centre), per_sample = 1 / now.middle.along;
        float place = place_of(now, i, now.middle.across * per_sample, now.middle.sigma * per_sample, shift);
        float in_position = shift - centre;
#endif
#pragma unroll
        for (int c = 0; c < PIXELS; c++) {
            float j = lane * PIXELS + c - SIDE / 2, q = q_of(now, i, j), sine, cosine;
            float rest = curvature_at(now.middle, i, j, q) - centre, cycles = rest * now.middle.kappa;
            cycles -= nearest(cycles);
            if (to) {
                float other = (curvature_at(next.middle, i, j, q) - centre_next) * next.middle.kappa;
                cycles -= other - nearest(other);
                cycles -= nearest(cycles);
            }
            float re = s->re[0][c], im = s->im[0][c];
#if SLOPE_TAPS
            float off = rest - in_position - now.bend * fma(j + j, place, j * j);
            re = fma(s->slope_re[0][c], off, re);
            im = fma(s->slope_im[0][c], off, im);
#endif
            sincos_cycles(cycles, &sine, &cosine);
            float turned_re = fma(re, cosine, -im * sine), turned_im = fma(re, sine, im * cosine);
            if (!to) {
                size_t at = out.transposed ? (lane * PIXELS + c) * SIDE + r : r * SIDE + lane * PIXELS + c;
                add_compensated(out.image, out.image + 2 * out.pixels, at, turned_re);
                add_compensated(out.image + out.pixels, out.image + 3 * out.pixels, at, turned_im);
                turned_re = turned_im = 0;
            }
#pragma unroll
            for (int l = 0; l < LINES - 1; l++) {
                s->re[l][c] = s->re[l + 1][c];
                s->im[l][c] = s->im[l + 1][c];
#if SLOPE_TAPS
                s->slope_re[l][c] = s->slope_re[l + 1][c];
                s->slope_im[l][c] = s->slope_im[l + 1][c];
#endif
            }
            s->re[LINES - 1][c] = turned_re;
            s->im[LINES - 1][c] = turned_im;
#if SLOPE_TAPS
            s->slope_re[LINES - 1][c] = s->slope_im[LINES - 1][c] = 0;
#endif
        }
    }
}

// stride and origin are no neighbours: loaded as a pair, they cost four instructions per pulse on sm_90.
typedef struct {
    int stride, n, origin, n_used, first, n_tiles, groups;
    float step_x, step_y;
    ulong pixels;
} backproject_shared_lines_numbers;

// global size (ITEMS, tiles of this block, parts), local size (ITEMS, 1, 1). Each part adds `groups` groups of pulses to sums
// of its own, of image (parts, 4, pixels). Arguments as of `backproject`; constants as in
// tile_constants.cl:line_constants, schedule from schedule_pulses.cl; step_x, step_y: m per pixel along j and i;
// weights, slopes: of LINE_TAPS and SLOPE_TAPS taps; skipped (n_tiles), BEAM: (2, n_tiles)
__kernel __attribute__((GROUP_SIZE)) void backproject_shared_lines(backproject_shared_lines_numbers given, tap_table table, line_table weights, slope_table slopes,
                              __global const float *restrict profiles, __global const float *restrict constants,
                              __global const int *restrict schedule, __global float *restrict image,
                              __global int *restrict skipped) {
    __local pulse_lines halves[2];
    __local float4 numbers[GROUP * N_ENTRY / 4];  // entries of a group's pulses: read once, by all items together
    int item = get_local_id(0), lane = item % ACROSS, r0 = item / ACROSS, tile = given.first + get_global_id(1);
    int all = (given.n_used + GROUP - 1) / GROUP, before = get_global_id(2) * given.groups;
    int groups = min(given.groups, all - before), chunk = 0, by_lines = 0, by_pixels = 0, transposed = 0;
    int missed = 0, unlit = 0, stride = given.stride, origin = given.origin;
    float step_x = given.step_x, step_y = given.step_y;
    size_t pixels = given.pixels;
    __global const float *records = constants + get_global_id(1) * (size_t)given.n * N_LINE, *middle = records;
    schedule += (get_global_id(1) * (size_t)all + before) * N_GROUP;
    profiles += 2 * origin;
    sums s;
    CLEAR(s.re)
    CLEAR(s.im)
#if SLOPE_TAPS
    CLEAR(s.slope_re)
    CLEAR(s.slope_im)
#endif
    for (int g = 0; g <= groups; g++) {
        __global const int *head = schedule + (size_t)min(g, groups - 1) * N_GROUP, *entries = head + N_HEAD;
        int n_lines = g < groups ? head[H_LINES] : 0, n_pixels = g < groups ? head[H_PIXELS] : 0;
        __global const float *next = records + (size_t)head[H_MIDDLE] * N_LINE;
        group pulses = group_of(next, step_x, step_y);
        barrier(CLK_GLOBAL_MEM_FENCE);  // lines may run along the other axis than before: pixels change hands
        int turned = n_lines && by_lines && pulses.transposed != transposed;
        if (g == groups || (g - chunk) * GROUP >= CHUNK || turned) {
            place out = {image + (get_global_id(2) * 4 * pixels + (size_t)tile * (SIDE * SIDE)), pixels, transposed};
            if (by_lines) turn(&s, middle, 0, step_x, step_y, r0, lane, out);
            // pulses pixel by pixel: rows and columns of the image, each item at the pixels of its sums
            for (int k = 0; by_pixels && k < LINES * PIXELS; k++) {
                int r = r0 + k / PIXELS * AT_ONCE, j = lane * PIXELS + k % PIXELS;
                int y = transposed ? j : r, x = transposed ? r : j;
                float re = 0, im = 0;
                group plain = group_of(records, step_x, step_y);
                plain.transposed = 0;
                plain.step_i = step_y;
                plain.step_j = step_x;
                for (int h = chunk; h < g; h++) {
                    __global const int *entry = schedule + (size_t)(h + 1) * N_GROUP - N_ENTRY;
                    for (int f = schedule[(size_t)h * N_GROUP + H_PIXELS]; f > 0; f--, entry -= N_ENTRY)
                        add_pixels(plain, records + (size_t)entry[E_PULSE] * N_LINE, y - SIDE / 2, x - SIDE / 2,
                                   profiles + 2 * (size_t)entry[E_PULSE] * stride, stride, origin, table.of, &re, &im);
                }
                add_compensated(out.image, out.image + 2 * pixels, y * SIDE + x, re);
                add_compensated(out.image + pixels, out.image + 3 * pixels, y * SIDE + x, im);
            }
            chunk = g;
            by_lines = by_pixels = 0;
        }
        if (n_lines) {
            place none = {image, pixels, 0};
            if (by_lines) turn(&s, middle, next, step_x, step_y, r0, lane, none);
            middle = next;
            transposed = pulses.transposed;
        }
        by_lines += n_lines;
        by_pixels += n_pixels;
        if (g < groups) {
            missed += head[H_OUTSIDE] & 65535;
            unlit += head[H_OUTSIDE] >> 16;
        }
        for (int k = item; k < n_lines * (N_ENTRY / 4); k += ITEMS) numbers[k] = ((__global const float4 *)entries)[k];
        barrier(CLK_LOCAL_MEM_FENCE);
        // T and the weights of a pulse are made after the sums of the pulse before it, in the half that nobody reads
        for (int f = n_lines ? -1 : 0; f < n_lines; f++) {
            __local const float *entry = (__local const float *)numbers + N_ENTRY * (f + 1);
            int count = f + 1 < n_lines ? as_int(entry[E_COUNT]) : 0;
            __local pulse_lines *pulse = &halves[(f + 1) & 1];
            __global const float *row = profiles;
            profile_samples samples;
            if (item < count) {
                row += 2 * (size_t)as_int(entry[E_PULSE]) * stride;
                if (AHEAD) read_profile(pulses, entry, item, row, stride, origin, &samples);
            }
            if (f >= 0) sum_lines(&s, r0, lane, &halves[f & 1]);
            if (item < count) {
                if (!AHEAD) read_profile(pulses, entry, item, row, stride, origin, &samples);
                write_sample(&samples, entry, item, table.of, pulse->T);
            }
#pragma unroll 1
            for (int k = item + ITEMS; k < count; k += ITEMS) {
                read_profile(pulses, entry, k, row, stride, origin, &samples);
                write_sample(&samples, entry, k, table.of, pulse->T);
            }
            if (item >= ITEMS - WEIGHING && count)
                for (int r = item - (ITEMS - WEIGHING); r < SIDE; r += WEIGHING)
                    weigh_line(pulses, entry, r, weights.of, slopes.of, pulse);
            barrier(CLK_LOCAL_MEM_FENCE);
        }
    }
    if (item == 0) {
        atomic_add(skipped + tile, missed);
        if (BEAM) atomic_add(skipped + given.n_tiles + tile, unlit);
    }
}
