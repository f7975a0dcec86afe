// Direct backprojection onto square tiles of a plane, a line of pixels at a time, shared by a work-group: the sums of
// backproject_lines.cl for devices with one lane per work-item (GPUs).
//
//   delta(i, j) = A_i + j beta + rest_ij,    I_ij += sum_b W_b(i) T(n_i + b + FINE j)
//
// A work-group adds up a tile. For each pulse its items make T and the weights of all lines in local memory, then each item
// adds LINE_TAPS products to each of its pixels, which stay in registers: no gather, sine, cosine or wide number per pixel.
//
// source    backproject_lines.cl, also for pulses that are added pixel by pixel. The sums are kept without the rest_ij of a
//           group of pulses, that of its middle pulse: where groups change, and after CHUNK pulses, sums are turned by the
//           difference of the phases. T is stored by periods of the items' pixels, so that neighbouring items read
//           neighbouring numbers of local memory, and the places of all samples that an item reads are constants.
//           T(m) holds the bend of the group's lines too (line_group.clh:bend_of), at m beta/FINE + bend (m/FINE)^2 with the
//           carrier of m beta/FINE: of the positions, rest_ij is then what the bend leaves.
// symbols   T, W, n_i, rest_ij, beta   as in backproject_lines.cl
// macros    FP64, BISTATIC, WRAP, TAPS, TERMS, ORDER, BEAM, SIDE, FINE, LINE_TAPS, LINE_TERMS, GROUP as in
//           backproject_lines.cl;  SHARED 1, see line_geometry.clh
//           ITEMS     work-items of a group;  CHUNK  pulses added in float32 before they join the compensated total
//           SLOPE_TAPS, SLOPE_TERMS  of the slopes of the weights, by which rest_ij moves each pixel's position; 0: none
// reference: sarcl/reference/backproject.py:backproject

#undef VW
#define VW 1
#define RANGE 0
#define BY_VALUE 1
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "range_phase.clh"
#include "line_geometry.clh"
#include "line_group.clh"
#include "line_schedule.clh"

#define PIXELS 4                                // neighbouring pixels of a line that belong to a work-item
#define ACROSS (SIDE / PIXELS)                  // work-items that share a line
#define AT_ONCE (ITEMS / ACROSS)                // lines that the work-group adds to at a time
#define LINES (SIDE / AT_ONCE)                  // lines that a work-item adds to, every AT_ONCE-th
#define PERIOD (FINE * PIXELS)                  // samples of T from a work-item's first pixel to its neighbour's
#define READ ((PIXELS - 1) * FINE + LINE_TAPS)  // samples of T over which a work-item's pixels of a line reach
// Sample m of T is stored at row m % PERIOD, column m / PERIOD, and again PERIOD rows and one column before: so the samples
// that an item reads lie in one column, whichever comes first.
#define ROWS (PERIOD + READ - 1)
#define COLUMNS (MOST / PERIOD + 1)

DEFINE_WEIGHTS(line_weights, LINE_TAPS, LINE_TERMS)
#if SLOPE_TAPS
DEFINE_SLOPES(line_slopes, SLOPE_TAPS, SLOPE_TERMS)
#define OUTER ((LINE_TAPS - SLOPE_TAPS) / 2)  // taps on either side that have no slopes
#endif

typedef struct {
    float of[LINE_TAPS * LINE_TERMS];
} line_table;
typedef struct {
#if SLOPE_TAPS
    float of[SLOPE_TAPS * SLOPE_TERMS];
#else
    float of[LINE_TAPS * LINE_TERMS];  // not read
#endif
} slope_table;

// What the items of a work-group make of a pulse together.
typedef struct {
    float4 W[SIDE * LINE_TAPS / 2];
#if SLOPE_TAPS
    float4 V[SIDE * SLOPE_TAPS / 2];
#endif
    float2 T[ROWS * COLUMNS];
    int at[SIDE];
} pulse_lines;

// Weights W_b of line r, and their slopes V_b; where the line's first sample of T is stored.
INLINED void weigh_line(group pulses, __global const float *restrict entry, int r, TABLE weights, TABLE slopes,
                        __local pulse_lines *made) {
    float4 numbers = FOUR(entry, E_PULSE), steps = FOUR(entry, E_STEP), ratios = FOUR(entry, E_FINE_LOW);
    float4 phases = FOUR(entry, E_ACROSS_LOW), u = FOUR(entry, E_U_X), v = FOUR(entry, E_V_X);
    float fine = steps.w, fine_low = ratios.x, samples_of_T = phases.w;
    line_geometry line;
    line.u = (direction){u.x, u.y, 0, u.z, u.w};
    line.v = (direction){v.x, v.y, 0, v.z, v.w};
    float i = r - SIDE / 2, centre = curvature_at(line, i, 0, q_of_line(pulses, i)), weight[LINE_TAPS];
    // i times the ratio of steps, in two parts: the first product is exact
    float product = i * ratios.y, whole = nearest(product), rest = fma(i, ratios.z, product - whole);
    float shift = in_position_of(pulses, line, i, centre);
    float place = place_of(pulses, i, ratios.y * (1.0f / FINE), samples_of_T * (1.0f / FINE), shift);
    float t = fma(shift - pulses.bend * place * place, samples_of_T, rest) - 0.5f * (LINE_TAPS - 1), first = nearest(t), z = t - first;
    line_weights(z, weights, weight);
#if SLOPE_TAPS
    float slope[SLOPE_TAPS];
    line_slopes(z, slopes, slope);
#endif
    first += whole;
    float cycles = cycles_of(i, ratios.w, phases.x) + phases.y;
    cycles = fma(centre, phases.z, cycles);
    cycles -= nearest(cycles);
    cycles -= cycles_of(first, fine, fine_low);
    cycles -= nearest(cycles);
    // from tap to tap the phase falls by that of a FINE-th of a pixel: turned from the middle outwards, where weights are small
    float cosine[LINE_TAPS], sine[LINE_TAPS], step_sine, step_cosine, of_tap = cycles - (LINE_TAPS / 2) * fine;
    of_tap = of_tap - (LINE_TAPS / 2) * fine_low;
    sincos_cycles(of_tap - nearest(of_tap), &sine[LINE_TAPS / 2], &cosine[LINE_TAPS / 2]);
    sincos_cycles(fine + fine_low, &step_sine, &step_cosine);
#pragma unroll
    for (int b = LINE_TAPS / 2 + 1; b < LINE_TAPS; b++) {
        cosine[b] = fma(cosine[b - 1], step_cosine, sine[b - 1] * step_sine);
        sine[b] = fma(sine[b - 1], step_cosine, -cosine[b - 1] * step_sine);
    }
#pragma unroll
    for (int b = LINE_TAPS / 2 - 1; b >= 0; b--) {
        cosine[b] = fma(cosine[b + 1], step_cosine, -sine[b + 1] * step_sine);
        sine[b] = fma(sine[b + 1], step_cosine, cosine[b + 1] * step_sine);
    }
    __local float2 *W = (__local float2 *)made->W + r * LINE_TAPS;
#pragma unroll
    for (int b = 0; b < LINE_TAPS; b++) {
        W[b] = (float2)(weight[b] * cosine[b], weight[b] * sine[b]);
#if SLOPE_TAPS
        if (b >= OUTER && b < OUTER + SLOPE_TAPS) {
            float per_metre = slope[b - OUTER] * samples_of_T;
            ((__local float2 *)made->V)[r * SLOPE_TAPS + b - OUTER] = (float2)(per_metre * cosine[b], per_metre * sine[b]);
        }
#endif
    }
    // no rounding, however unlikely, may lead outside of T
    int from = as_int(numbers.y), count = as_int(numbers.z);
    int m = clamp((int)first - from - FINE * (SIDE / 2), 0, count - FINE * (SIDE - 1) - LINE_TAPS);
    made->at[r] = m % PERIOD * COLUMNS + m / PERIOD;
}

// Sample number k of T: the profile of a pulse at a place of a line, carrier included. row: its profile.
INLINED void take_sample(group pulses, __global const float *restrict entry, int k, __global const float *restrict row, int stride,
                         int origin, TABLE table, __local float2 *T) {
    float4 numbers = FOUR(entry, E_PULSE), steps = FOUR(entry, E_STEP);
    float m = k + as_int(numbers.y), re, im, sine, cosine;
    // m times the step, in two parts: the first product is exact
    float product = m * steps.x, whole = nearest(product);
    // the bend in samples of the profile: entry[E_SAMPLES] is that of T per metre
    float bend = pulses.bend * entry[E_SAMPLES] * (1.0f / (FINE * FINE)) * (steps.x + steps.y);
    float t = fma(m, fma(m, bend, steps.y), product - whole) + steps.z;
    look_up(row, stride, origin, as_int(numbers.w) + nearest_int(product), t, table, &re, &im);
    sincos_cycles(cycles_of(m, steps.w, entry[E_FINE_LOW]), &sine, &cosine);
    float2 sample = (float2)(fma(re, cosine, -im * sine), fma(re, sine, im * cosine));
    uint row_of = (uint)k % PERIOD, column = (uint)k / PERIOD;
    T += row_of * COLUMNS + column;
#pragma unroll
    for (int copy = 0; copy * PERIOD < ROWS; copy++)
        if (row_of + copy * PERIOD < ROWS && column >= copy) T[copy * (PERIOD * COLUMNS - 1)] = sample;
}

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
    int stride, n, origin, n_used, first, n_tiles;
    float step_x, step_y;
    ulong pixels;
} backproject_shared_lines_numbers;

// global size (ITEMS, tiles of this block), local size (ITEMS, 1). Arguments as of `backproject`; constants as in
// tile_constants.cl:line_constants, schedule from schedule_pulses.cl; step_x, step_y: m per pixel along j and i;
// weights, slopes: of LINE_TAPS and SLOPE_TAPS taps; skipped (n_tiles), BEAM: (2, n_tiles)
__kernel __attribute__((reqd_work_group_size(ITEMS, 1, 1))) void
backproject_shared_lines(backproject_shared_lines_numbers given, tap_table table, line_table weights, slope_table slopes,
                         __global const float *restrict profiles, __global const float *restrict constants,
                         __global const int *restrict schedule, __global float *restrict image,
                         __global int *restrict skipped) {
    __local pulse_lines halves[2];
    int item = get_local_id(0), lane = item % ACROSS, r0 = item / ACROSS, tile = given.first + get_global_id(1);
    int groups = (given.n_used + GROUP - 1) / GROUP, chunk = 0, by_lines = 0, by_pixels = 0, made = 0, transposed = 0;
    int missed = 0, unlit = 0, stride = given.stride, origin = given.origin;
    float step_x = given.step_x, step_y = given.step_y;
    size_t pixels = given.pixels;
    __global const float *records = constants + get_global_id(1) * (size_t)given.n * N_LINE, *middle = records;
    schedule += get_global_id(1) * (size_t)groups * N_GROUP;
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
            place out = {image + (size_t)tile * (SIDE * SIDE), pixels, transposed};
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
        for (int f = 0; f < n_lines; f++) {
            __global const float *entry = (__global const float *)entries + N_ENTRY * f;
            __local pulse_lines *pulse = &halves[made++ & 1];
            __global const float *row = profiles + 2 * (size_t)as_int(entry[E_PULSE]) * stride;
            int count = as_int(entry[E_COUNT]);
            // few samples are more than there are items: the first items make those, the last ones the weights
#pragma unroll 1
            for (int k = item; k < count; k += ITEMS) take_sample(pulses, entry, k, row, stride, origin, table.of, pulse->T);
            if (item >= ITEMS - SIDE) weigh_line(pulses, entry, item - (ITEMS - SIDE), weights.of, slopes.of, pulse);
            // the other half may still be read: it is not written before the next barrier
            barrier(CLK_LOCAL_MEM_FENCE);
            sum_lines(&s, r0, lane, pulse);
        }
    }
    if (item == 0) {
        skipped[tile] += missed;
#if BEAM
        skipped[given.n_tiles + tile] += unlit;
#endif
    }
}
