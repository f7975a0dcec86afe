// Which sample points of facets stand in the shadow of a terrain: horizons along range lines.
//
//   zeta(x) = z(x) + (z(x) - z_eye) (ref - x)/(x - x_eye),   H_j(c) = max of zeta on line j as far out as column c
//   sample hidden = some edge of the terrain between it and the eye rises above the line of sight: zeta < H
//
// source    perspective about the eye onto the upright plane x = ref beyond the terrain: lines of sight become points
//           (b, zeta), b the position across; prefix maxima are horizons. Finite distances are exact, in plan and height.
// symbols   along, across   coordinates of grid lines; for lines along y the axes change roles
//           z         heights (n_across, n_along); everything in units of the scene, see facet_points.clh
//           line      (lines, 2): b and the slope (b - across_eye)/(ref - along_eye)
//           column    grid line across the range lines; a gap lies between two of them, where a range line crosses at
//                     most one grid line of the other kind, and diagonals from south-west to north-east
//           slope     change of `across` per unit `along`;  climb, rise  change of height, of `across`
//           per_across  grid lines per unit across: the first guess of an interval
//           table     H (lines, columns)
//           sector    4 x 8 numbers and 4 x 8 integers: outwards along +x, -x, +y, -y; see sarcl/visibility/_terrain_horizon.py
//           index, kind, line, word   as in ray_casting.cl; one line of sight decides on `step` samples
// macros    LINES  as in facet_points.clh
// reference: sarcl/reference/shadow.py:overshadowed

#include "facet_points.clh"

#define NONE -1e30f

// number of the interval of increasing values that v lies in, 0 ... n - 2; `guess` is near it
static inline int interval_of(__global const float *value, int n, float v, float guess) {
    int i = clamp((int)guess, 0, n - 2);
    while (i > 0 && value[i] > v) i--;
    while (i < n - 2 && value[i + 1] <= v) i++;
    return i;
}

// a/b, the same on every device: OpenCL allows its division some rounding
static inline float ratio(float a, float b) {
    float q = a / b;
    return q + fma(-q, b, a) / b;
}

// the grid of one sector, along its range lines and across; `transposed` in behind exchanges x and y
typedef struct {
    __global const float *z, *along, *across;
    int n_along, n_across;
    float per_across, ref, eye, eye_z;
} Grid;

static inline float zeta(Grid g, float height, float at) { return height + (height - g.eye_z) * ratio(g.ref - at, at - g.eye); }

// Where a line of sight meets an edge of the terrain: height low + u (high - low) at along + u wide, u = share/whole.
// No division: whole > 0, and there is nothing to meet unless 0 <= share <= whole.
typedef struct {
    float low, high, share, whole;
} Edge;

static inline Edge edge_of(float low, float high, float share, float whole) {
    Edge e = {low, high, whole < 0 ? -share : share, fabs(whole)};
    return e;
}

static inline int met(Edge e) { return e.share >= 0 && e.share <= e.whole && e.whole > 0; }

// column i, `at` across
static inline Edge column_edge(Grid g, int i, float at) {
    int r = interval_of(g.across, g.n_across, at, (at - g.across[0]) * g.per_across);
    __global const float *z = g.z + (size_t)r * g.n_along + i;
    return edge_of(z[0], z[g.n_along], at - g.across[r], g.across[r + 1] - g.across[r]);
}

// between columns i and i + 1, of a line that passes `from` across at the first and `rise` more at the second: the diagonals
// of the cells at both ends, k = 0 and 1, and the grid line between them, k = 2
static inline Edge gap_edge(Grid g, int i, float from, float rise, int ra, int rb, int k) {
    int r = k == 0 ? ra : k == 1 ? rb : max(ra, rb);
    float there = g.across[r];
    __global const float *z = g.z + (size_t)r * g.n_along + i;
    return k == 2 ? edge_of(z[0], z[1], there - from, rise)
                  : edge_of(z[0], z[g.n_along + 1], from - there, g.across[r + 1] - there - rise);
}

typedef struct {
    int n_along, n_across, first, step, columns, offset;
    float per_across, eye, eye_z, ref;
} sweep_numbers;

__kernel void sweep(sweep_numbers given, __global const float *restrict z, __global const float *restrict along,
                    __global const float *restrict across, __global const float2 *restrict line,
                    __global float *restrict table) {
    size_t j = get_global_id(0);
    Grid g = {z, along, across, given.n_along, given.n_across, given.per_across, given.ref, given.eye, given.eye_z};
    __global float *out = table + given.offset + j * given.columns;
    float most = NONE, slope = line[j].y;
    for (int c = 0; c < given.columns; c++) {
        int i = given.first + c * given.step, gap = given.step > 0 ? i - 1 : i;
        if (gap >= 0 && gap < given.n_along - 1) {
            float wide = along[gap + 1] - along[gap], rise = slope * wide, from = line[j].x + slope * (along[gap] - given.ref);
            int ra = interval_of(across, given.n_across, from, (from - across[0]) * given.per_across);
            int rb = interval_of(across, given.n_across, from + rise, (from + rise - across[0]) * given.per_across);
            for (int k = 0; k < (ra == rb ? 1 : 3); k++) {
                Edge e = gap_edge(g, gap, from, rise, ra, rb, k);
                float u = ratio(e.share, e.whole), at = along[gap] + u * wide;
                if (met(e) && (at - given.eye) * given.step > 0) most = fmax(most, zeta(g, e.low + u * (e.high - e.low), at));
            }
        }
        float at = line[j].x + slope * (along[i] - given.ref);
        Edge e = column_edge(g, i, at);
        // lines half a cell outside still help those inside
        if (fmax(across[0] - at, at - across[given.n_across - 1]) * given.per_across <= 0.5f)
            most = fmax(most, zeta(g, e.low + ratio(e.share, e.whole) * (e.high - e.low), along[i]));
        out[c] = most;
    }
}

// does the terrain rise above the line from (x, y, z) between columns i and i + 1, on the eye's side of x?
static inline int gap_above(Grid g, int i, float x, float y, float z, float slope, float climb, int step) {
    if (i < 0 || i > g.n_along - 2) return 0;
    float a = g.along[i], wide = g.along[i + 1] - a, from = y + slope * (a - x), rise = slope * wide;
    float here = z + climb * (a - x), more = climb * wide, back = (a - x) * step, past = (a - g.eye) * step;
    int ra = interval_of(g.across, g.n_across, from, (from - g.across[0]) * g.per_across);
    int rb = interval_of(g.across, g.n_across, from + rise, (from + rise - g.across[0]) * g.per_across);
    for (int k = 0; k < (ra == rb ? 1 : 3); k++) {
        Edge e = gap_edge(g, i, from, rise, ra, rb, k);
        float way = wide * step * e.share;
        if (met(e) && back * e.whole + way < 0 && past * e.whole + way > 0 &&
            (e.low - here) * e.whole + (e.high - e.low - more) * e.share > 0)
            return 1;
    }
    return 0;
}

static inline int behind(float3 p, float3 eye, __global const float *grid_x, __global const float *grid_y,
                         __global const float *z_rows, __global const float *z_columns, int nx, int ny, float per_x, float per_y,
                         __global const float *number, __global const int *whole, __global const float *table) {
    int transposed = fabs(p.y - eye.y) * per_y > fabs(p.x - eye.x) * per_x;
    float x = transposed ? p.y : p.x, y = transposed ? p.x : p.y, ex = transposed ? eye.y : eye.x, ey = transposed ? eye.x : eye.y;
    int s = 2 * transposed + (x < ex);
    whole += 8 * s;
    number += 8 * s;
    int first = whole[0], step = whole[1], columns = whole[2], lines = whole[3];
    if (columns == 0) return 0;
    float ref = number[0];
    Grid g = {transposed ? z_columns : z_rows, transposed ? grid_y : grid_x, transposed ? grid_x : grid_y, transposed ? ny : nx,
              transposed ? nx : ny, transposed ? per_x : per_y, ref, ex, eye.z};
    __global const float *along = g.along;
    // the column next to p on its way to the eye
    int r = interval_of(along, g.n_along, x, (x - along[0]) * (transposed ? per_y : per_x)), i;
    if (step > 0)
        i = along[r + 1] < x ? r + 1 : along[r] < x ? r : r - 1;
    else
        i = along[r] > x ? r : along[r + 1] > x ? r + 1 : r + 2;
    int c = (i - first) * step;
    float slope = ratio(y - ey, x - ex);
    float climb = ratio(p.z - eye.z, x - ex);
    // cells next to p itself: a table between lines would let a facet hide itself
    if (gap_above(g, step > 0 ? i : i - 1, x, y, p.z, slope, climb, step)) return 1;
    if (c < 0) return 0;
    Edge e = column_edge(g, i, y + slope * (along[i] - x));
    if (met(e) && (e.low - p.z - climb * (along[i] - x)) * e.whole + (e.high - e.low) * e.share > 0) return 1;
    if (gap_above(g, step > 0 ? i - 1 : i, x, y, p.z, slope, climb, step)) return 1;
    if (c == 0) return 0;
    float at = (y + slope * (ref - x) - number[1]) * number[2];
    if (at < 0 || at > lines - 1) return 0;
    int j = min((int)at, lines - 2);
    __global const float *row = table + whole[4] + (size_t)j * columns + c - 1;
    return row[0] + (at - j) * (row[columns] - row[0]) > zeta(g, p.z, x);
}

typedef struct {
    int step, nx, ny;
    float eye[3], other[3], per_x, per_y;
} horizon_numbers;

__kernel void horizon(horizon_numbers given, __global const float *restrict facet, __global const int *restrict index,
                      __global const uchar *restrict kind, __global const float *restrict line,
                      __global const float *restrict x, __global const float *restrict y,
                      __global const float *restrict z_rows, __global const float *restrict z_columns,
                      __global const float *restrict number, __global const int *restrict whole,
                      __global const float *restrict table, __global int *restrict word) {
    size_t i = get_global_id(0);
    __global const float *f = facet + 12 * (size_t)index[i];
    float3 eye = vload3(0, given.eye), other = vload3(0, given.other);
    int dark = 0, probed = !(kind[index[i]] & ALL_SAMPLES);
    word += i * LINES;
    if (is_behind(f, eye, other) || all_hidden(word)) return;
    for (int s = probed ? -PROBES : 0; s < LINES * PER_LINE; s += s < 0 ? 1 : given.step) {
        if (s == 0 && probed && dark == 0) return;
        int l = max(s, 0) / PER_LINE, bit = max(s, 0) % PER_LINE, some = some_samples(bit, given.step);
        if (s == 0 && dark == PROBES) {
            for (int k = 0; k < LINES; k++) word[k] = -1;
            return;
        }
        if (s >= 0 && (word[l] & some) == some) continue;
        float2 at = s < 0 ? probe_at(s + PROBES) : sample_at(line, l, bit, given.step);
        float3 p = lifted(f, at, eye, other);
        if (!behind(p, eye, x, y, z_rows, z_columns, given.nx, given.ny, given.per_x, given.per_y, number, whole, table)) continue;
        if (s < 0)
            dark++;
        else
            word[l] |= some;
    }
}
