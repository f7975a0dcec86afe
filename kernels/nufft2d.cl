// Samples at uneven positions in the plane of wavenumbers, spread on an even grid: a type-1 nonuniform FFT's first step.
//
//   g[c0, c1] = sum_p sum_n s_pn w(c0 - t0_p(n)) w(c1 - t1_p(n)),   indices modulo (M0, M1)
//   t_p(n) = cell_p + rest_p + (n - MIDDLE) step_p,   in cells of the grid;  w of interp.clh
//
// source    Farooq 2009, equation 2.64 (its interpolation I, without a raster); sarcl/numerics/nufft2d.py
// symbols   s_pn      sample n of row p, weighted
//           cell, rest   (n_rows, 2) int, and in `line`: whole cells and the rest of the row's middle sample
//           step      high + low: `high` has so few bits that n high is exact, and whole cells are resolved exactly;
//                     the same sample falls into the same cell whichever tile looks at it
//           line      (n_rows, 6): rest0, high0, low0, rest1, high1, low1
//           period    q0 M0, q1 M1: cells by which the copy of the grid that a line crosses is displaced
//           table     (TAPS/2, 2, TERMS) as interp.clh reads it
// macros    VW        1: the lanes are the taps of a sample
//           TAPS, TERMS, TILE, GROUPED   as in grid_tile.clh;  M0, M1 >= TILE + 2 TAPS + 4
// reference: sarcl/reference/polar_format.py:spread

#include "common.clh"
#include "interp.clh"
#include "grid_tile.clh"

// Samples first ... last of a line whose position on one axis, middle + n step, may lie in [low, high].
static inline void clip(float low, float high, float middle, float step, int *first, int *last) {
    float slope = step == 0 ? 1e-30f : step, a = (low - middle) / slope, b = (high - middle) / slope;
    *first = max(*first, (int)floor(clamp(fmin(a, b), -1e9f, 1e9f)));
    *last = min(*last, (int)ceil(clamp(fmax(a, b), -1e9f, 1e9f)));
}

// Periods of m cells in which a line's samples first ... last may meet [low, high].
static inline void periods(float low, float high, float middle, float step, int m, int first, int last, int *from, int *to) {
    float a = fma((float)first, step, middle), b = fma((float)last, step, middle);
    *from = (int)ceil((fmin(a, b) - high) / m - 1e-3f);
    *to = (int)floor((fmax(a, b) - low) / m + 1e-3f);
}

// First tap of sample n on one axis, counted from the row's whole cell, and where it lies between taps.
static inline int first_cell(float n, float rest, float high, float low, float *z) {
    float whole = n * high, cell = floor(whole), position = (whole - cell) + fma(n, low, rest), more = floor(position);
    *z = position - more - 0.5f;
    return (int)cell + (int)more - TAPS / 2 + 1;
}

// Where a tile's samples may lie: positions low ... high on each axis.
typedef struct {
    float low0, high0, low1, high1;
} reach;

// Samples first ... last of a row that may lie in the tile along axis 0, of its copy that is q0 periods away.
static inline void along0(reach of, float t0, float d0, float period, int n_samples, int *first, int *last) {
    *first = -(n_samples / 2);
    *last = n_samples - 1 - n_samples / 2;
    clip(of.low0 + period, of.high0 + period, t0, d0, first, last);
}

// Whether a row may have samples in the tile.
static inline int meets(reach of, __global const int *cell, __global const float *l, int m0, int m1, int n_samples) {
    float t0 = cell[0] + l[0], d0 = l[1] + l[2], t1 = cell[1] + l[3], d1 = l[4] + l[5];
    int from0, to0, from1, to1, middle = n_samples / 2, found = 0;
    periods(of.low0, of.high0, t0, d0, m0, -middle, n_samples - 1 - middle, &from0, &to0);
    for (int q0 = from0; q0 <= to0 && !found; q0++) {
        int begin, end;
        along0(of, t0, d0, (float)q0 * m0, n_samples, &begin, &end);
        if (begin <= end) {
            periods(of.low1, of.high1, t1, d1, m1, begin, end, &from1, &to1);
            found = from1 <= to1;
        }
    }
    return found;
}

// Sample n of a row, of which a copy is displaced to where whole cell (row, column) lies in the tile.
static inline grid_sample sample_of(int n, int row, int column, __global const float *l, __global const float *samples) {
    grid_sample s;
    s.row = row + first_cell(n, l[0], l[1], l[2], &s.z0);
    s.column = column + first_cell(n, l[3], l[4], l[5], &s.z1);
    s.value = vload2(n, samples);
    return s;
}

typedef struct {
    int n_rows, n_samples, m0, m1, first, add;
} spread_numbers;

// global size (tiles along axis 1, tiles along axis 0 in this band), times the group (8, 8) where GROUPED: a work-item, or
// a group, owns one tile of the grid.
//   samples  (n_rows, n_samples, 2)
//   first    tile row of the band;  out (rows of the band, M1, 2);  add: 1 adds to the values there, 0 overwrites them
__kernel void spread(spread_numbers given, __global const float *restrict samples, __global const int *restrict cell,
                     __global const float *restrict line, __global const float *restrict table, __global float *out) {
    int n_samples = given.n_samples, m0 = given.m0, m1 = given.m1, first = given.first;
    int item = ITEM;
    int base0 = TILE * (first + (int)get_global_id(1) / ACROSS), base1 = TILE * ((int)get_global_id(0) / ACROSS);
    TILE_SPACE tile_sums tile;
    __local int met[ITEMS]; // rows that may have samples in the tile
    clear_tile(&tile);
    int middle = n_samples / 2;
    reach of = {base0 - TAPS / 2 - 1, base0 + TILE + TAPS / 2, base1 - TAPS / 2 - 1, base1 + TILE + TAPS / 2};
    for (int p = 0; p < given.n_rows; p++) {
        __global const float *l = line + 6 * (size_t)p, *row = samples + 2 * ((size_t)p * n_samples + middle);
        if (GROUPED && p % ITEMS == 0) { // items look at a row each, and the group passes over those that none meets
            barrier(CLK_LOCAL_MEM_FENCE);
            int mine = p + item;
            met[item] = mine < given.n_rows && meets(of, cell + 2 * mine, line + 6 * (size_t)mine, m0, m1, n_samples);
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        if (GROUPED && !met[p % ITEMS]) continue;
        float t0 = cell[2 * p] + l[0], d0 = l[1] + l[2], t1 = cell[2 * p + 1] + l[3], d1 = l[4] + l[5];
        int from0, to0, from1, to1;
        periods(of.low0, of.high0, t0, d0, m0, -middle, n_samples - 1 - middle, &from0, &to0);
        for (int q0 = from0; q0 <= to0; q0++) {
            int begin, end;
            along0(of, t0, d0, (float)q0 * m0, n_samples, &begin, &end);
            if (begin > end) continue;
            periods(of.low1, of.high1, t1, d1, m1, begin, end, &from1, &to1);
            for (int q1 = from1; q1 <= to1; q1++) {
                int start = begin, stop = end;
                float period1 = (float)q1 * m1;
                clip(of.low1 + period1, of.high1 + period1, t1, d1, &start, &stop);
                int shift0 = cell[2 * p] - q0 * m0 - base0, shift1 = cell[2 * p + 1] - q1 * m1 - base1;
                for (int n = start; n <= stop; n += ITEMS) {
                    int n_added = min(ITEMS, stop - n + 1);
                    if (item < n_added) put_sample(&tile, item, sample_of(n + item, shift0, shift1, l, row), table);
                    add_samples(&tile, n_added);
                }
            }
        }
    }
    for (int k = item; k < TILE * TILE; k += ITEMS) {
        int i = base0 + k / TILE, j = base1 + k % TILE;
        if (i < m0 && j < m1) {
            __global float *to = out + 2 * ((size_t)(i - TILE * first) * m1 + j);
            float2 s = sum_of_cell(&tile, k / TILE, k % TILE);
            vstore2(given.add ? vload2(0, to) + s : s, 0, to);
        }
    }
}
