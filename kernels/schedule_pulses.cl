// What is done with each pulse at each tile where work-groups share lines: by lines, or pixel by pixel.
//
// source    backproject_shared_lines.cl
// symbols   T, W, rest_ij   as in backproject_lines.cl
// macros    FP64, BISTATIC, WRAP, TAPS, TERMS, ORDER, BEAM, SIDE, FINE, LINE_TAPS, GROUP as in backproject_lines.cl;
//           SHARED 1, see line_geometry.clh
// reference: sarcl/reference/backproject.py:backproject

#undef VW
#define VW 1
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "tile_paths.clh"
#include "line_geometry.clh"
#include "line_group.clh"
#include "line_schedule.clh"

// First of the samples of T that the lines of a pulse read, counted about the reference pixel, and their number; 0 where
// they are too many to be stored, as for a steep pulse, or have no spacing.
INLINED int samples_needed(group pulses, line_geometry line, int *from) {
    if (!(fabs(line.along) >= LEAST_STEP)) return 0;
    float position[5], lowest = INFINITY, highest = -INFINITY, bend = 0, per_sample = 1 / line.along;
#pragma unroll
    for (int k = 0; k < 5; k++) {
        float i = (k - 2) * (SIDE / 4), centre = curvature_at(line, i, 0, q_of_line(pulses, i));
        float shift = in_position_of(pulses, line, i, centre), across = line.across * per_sample;
        float place = place_of(pulses, i, across, line.sigma * per_sample, shift);
        position[k] = FINE * fma(shift - pulses.bend * place * place, line.sigma * per_sample, i * across);
        lowest = fmin(lowest, position[k]);
        highest = fmax(highest, position[k]);
    }
    // positions are nearly a cubic of i: between two of five, no one lies farther outside than 3/8 of the largest second difference
#pragma unroll
    for (int k = 1; k < 4; k++) bend = fmax(bend, fabs(position[k - 1] - 2 * position[k] + position[k + 1]));
    lowest -= fma(0.5f, bend, 2.0f);
    highest += fma(0.5f, bend, 2.0f);
    if (!(highest - lowest < MOST && fabs(lowest) < MOST)) return 0;
    *from = (int)floor(lowest) - LINE_TAPS / 2 - FINE * (SIDE / 2);
    int count = (int)ceil(highest) + LINE_TAPS / 2 + FINE * (SIDE / 2) - *from;
    return count <= MOST ? count : 0;
}

typedef struct {
    int n, n_used;
    float step_x, step_y, limit_cycles, limit_position, limit_step;
} schedule_pulses_numbers;

// What is done with each pulse of a group, at each tile. global size (groups, tiles of this block)
//   constants   (tiles, n, N_LINE)      from tile_constants.cl:line_constants
//   schedule    (tiles, groups, N_GROUP)
__kernel void schedule_pulses(schedule_pulses_numbers given, __global const float *restrict constants,
                              __global int *restrict schedule) {
    int start = get_global_id(0) * GROUP, stop = min(start + GROUP, given.n_used);
    __global const float *records = constants + get_global_id(1) * (size_t)given.n * N_LINE;
    __global int *head = schedule + (get_global_id(1) * get_global_size(0) + get_global_id(0)) * N_GROUP;
    __global int *entries = head + N_HEAD;
    int inside = 0, crossing = 0, outside = 0, any = start;
    for (int p = start; p < stop; p++) {
        int state = as_int(records[(size_t)p * N_LINE + L_STATE]);
        inside += state == INSIDE;
        outside += state == OUTSIDE ? 1 : state == UNLIT ? 65536 : 0;
        if (state == CROSSING && !crossing++) any = p;
    }
    int middle = any, before = inside / 2, n_lines = 0, n_pixels = 0;
    for (int p = start; p < stop && inside; p++)
        if (as_int(records[(size_t)p * N_LINE + L_STATE]) == INSIDE && !before--) middle = p;
    group pulses = group_of(records + (size_t)middle * N_LINE, given.step_x, given.step_y);
    for (int p = start; p < stop && inside + crossing; p++) {
        __global const float *record = records + (size_t)p * N_LINE;
        int state = as_int(record[L_STATE]), from = 0, count = 0;
        if (state != INSIDE && state != CROSSING) continue;
        line_geometry line = load_line(record, pulses.transposed);
        if (state == INSIDE && fabs(line.along) <= given.limit_step &&
            fits(pulses, line, given.limit_cycles, given.limit_position))
            count = samples_needed(pulses, line, &from);
        __global int *entry = entries + N_ENTRY * (count ? n_lines++ : GROUP - ++n_pixels);
        entry[E_PULSE] = p;
        entry[E_FROM] = from;
        entry[E_COUNT] = count;
        entry[E_BASE] = line.base;
        int along = 2 * pulses.transposed;
        float values[N_ENTRY - E_STEP] = {
            record[L_STEP + along], record[L_STEP + along + 1], line.frac, line.fine_cycles, line.fine_cycles_low,
            record[L_RATIO + along], record[L_RATIO + along + 1], line.cycles_across, line.cycles_across_low, line.cycles,
            line.kappa, line.sigma * (FINE / line.along), line.u.x, line.u.y, line.u.inverse, line.u.R0,
            BISTATIC ? line.v.x : 0, BISTATIC ? line.v.y : 0, BISTATIC ? line.v.inverse : 0, BISTATIC ? line.v.R0 : 0};
#pragma unroll
        for (int k = 0; k < N_ENTRY - E_STEP; k++) entry[E_STEP + k] = as_int(values[k]);
    }
    head[H_LINES] = n_lines;
    head[H_PIXELS] = n_pixels;
    head[H_MIDDLE] = middle;
    head[H_OUTSIDE] = outside;
}
