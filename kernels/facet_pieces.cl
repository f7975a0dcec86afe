// Facets bisected at their longest edges until none is longer than a limit, and what facet_amplitudes.cl reads of each piece:
// computed piece by piece from the given facets, in their order.
//
//   (a, b, c), a b the longest edge  ->  (a, m, c) and (m, b, c),   m = (a + b)/2
//   piece     its path: a bit for each cut, 1 for the second half, behind a leading 1; pieces of a facet are in the order of
//             their paths, so that neighbours follow one another
//   x = (a + b + c)/3 + h n,   h = roughness N_0(x),   r = (N_2(x) + j N_3(x))/sqrt(2)
//   N_s(x)    standard normal number of position x and stream s (Box and Muller 1958), of two hashes
//
// source    longest-edge bisection: Rivara 1984; splitmix64: Steele, Lea and Flood 2014
// symbols   facets   float64 (n_facets, 12): corners (3, 3), m, and lengths of the edges from each on to the next, m
//           limit    of edges, m, float64
//           starts   int (n_facets): number of the first piece of each
//           n        pieces;  stride  distance of one plane from the next, whole tiles, the last of which the last piece fills
//           kinds    int (n_facets), and  surfaces  (n_surface, n_kinds) float64: what all pieces of a kind share
// macros    VW       lanes: facets, or pieces, side by side
// reference: sarcl/reference/facet_pieces.py:pieces
// Nothing here may be contracted to fused operations: every device is to give the same pieces.

#include "doubledouble.clh"
#pragma OPENCL FP_CONTRACT OFF

#if VW == 1
typedef ulong uv;
#define TO_FLOAT(x) convert_float(x)
#define TO_DOUBLE(x) convert_double(x)
#define AS_WORD(x) as_ulong(x)
#else
typedef CAT(ulong, VW) uv;
#define TO_FLOAT(x) CAT(convert_float, VW)(x)
#define TO_DOUBLE(x) CAT(convert_double, VW)(x)
#define AS_WORD(x) CAT(as_ulong, VW)(x)
#endif

#define MOST_CUTS 62  // bits of a path

typedef struct { dv x, y, z; } point;
typedef struct {
    point a, b, c;
    dv ab, bc, ca;  // lengths of the edges
} facet;

static inline point minus(point a, point b) {
    point d = {a.x - b.x, a.y - b.y, a.z - b.z};
    return d;
}
static inline point middle_of(point a, point b) {
    point m = {(a.x + b.x) * 0.5, (a.y + b.y) * 0.5, (a.z + b.z) * 0.5};
    return m;
}
static inline dv length_of(point p) { return sqrt(sum_of(sum_of(p.x * p.x, p.y * p.y), p.z * p.z)); }
static inline point chosen(lv is_first, point a, point b) {
    point p = {is_first ? a.x : b.x, is_first ? a.y : b.y, is_first ? a.z : b.z};
    return p;
}

// The facet with its corners from the longest edge on: the first of edges alike.
static inline facet from_longest(facet f) {
    lv second = f.bc > f.ab & f.bc >= f.ca, third = f.ca > f.ab & f.ca > f.bc;
    facet out = {chosen(second, f.b, chosen(third, f.c, f.a)), chosen(second, f.c, chosen(third, f.a, f.b)),
                 chosen(second, f.a, chosen(third, f.b, f.c)), second ? f.bc : (third ? f.ca : f.ab),
                 second ? f.ca : (third ? f.ab : f.bc), second ? f.ab : (third ? f.bc : f.ca)};
    return out;
}

// Its first half, or its second.
static inline facet half_of(facet f, lv is_second) {
    f = from_longest(f);
    point m = middle_of(f.a, f.b);
    dv cut = length_of(minus(f.c, m));
    facet out = {chosen(is_second, m, f.a), chosen(is_second, f.b, m), f.c, f.ab * 0.5, is_second ? f.bc : cut,
                 is_second ? cut : f.ca};
    return out;
}
static inline facet chosen_facet(lv is_first, facet f, facet g) {
    facet out = {chosen(is_first, f.a, g.a), chosen(is_first, f.b, g.b), chosen(is_first, f.c, g.c),
                 is_first ? f.ab : g.ab, is_first ? f.bc : g.bc, is_first ? f.ca : g.ca};
    return out;
}

// Facets of which each lane reads its own.
static inline facet load_facet(__global const double *restrict facets, const int *row) {
    double v[12][VW];
#pragma unroll
    for (int l = 0; l < VW; l++)
#pragma unroll
        for (int i = 0; i < 12; i++) v[i][l] = facets[12 * (size_t)row[l] + i];
    facet f;
    f.a.x = LOAD(0, v[0]), f.a.y = LOAD(0, v[1]), f.a.z = LOAD(0, v[2]);
    f.b.x = LOAD(0, v[3]), f.b.y = LOAD(0, v[4]), f.b.z = LOAD(0, v[5]);
    f.c.x = LOAD(0, v[6]), f.c.y = LOAD(0, v[7]), f.c.z = LOAD(0, v[8]);
    f.ab = LOAD(0, v[9]), f.bc = LOAD(0, v[10]), f.ca = LOAD(0, v[11]);
    return f;
}

static inline int any_lane(lv mask) {
#if VW == 1
    return mask != 0;
#else
    long v[VW], all = 0;
    STORE(mask, 0, v);
#pragma unroll
    for (int l = 0; l < VW; l++) all |= v[l];
    return all != 0;
#endif
}

typedef struct {
    int n_facets, listed;
    ulong limit;
} walk_pieces_numbers;

// Pieces of each facet: counted where `listed` is 0, else written from starts on. global size (facets/VW, or more).
//   counts  int (n_facets): 0 where a facet takes more than MOST_CUTS cuts, one after the other
//   owners, paths  int, ulong (n): facet and path of each piece
__kernel void walk_pieces(walk_pieces_numbers given, __global const double *restrict facets,
                          __global const int *restrict starts, __global int *restrict counts,
                          __global int *restrict owners, __global ulong *restrict paths) {
    int row[VW], first = get_global_id(0) * VW;
    long done_lane[VW];
#pragma unroll
    for (int l = 0; l < VW; l++) {
        row[l] = min(first + l, given.n_facets - 1);
        done_lane[l] = first + l < given.n_facets ? 0 : -1;
    }
    dv limit = (dv)as_double(given.limit);
    facet whole = load_facet(facets, row), f = whole;
    lv path = 1, level = 0, depth = 0, count = 0, is_done = LOAD(0, done_lane);
    while (any_lane(is_done == 0)) {
        lv is_within = level < depth, is_long = f.ab > limit | f.bc > limit | f.ca > limit;
        lv is_leaf = is_within == 0 & is_long == 0 & is_done == 0;
        if (any_lane(is_leaf)) {
            if (given.listed) {
                long leaf[VW], path_of[VW], rank[VW];
                STORE(is_leaf, 0, leaf);
                STORE(path, 0, path_of);
                STORE(count, 0, rank);
#pragma unroll
                for (int l = 0; l < VW; l++)
                    if (leaf[l]) {
                        owners[starts[row[l]] + rank[l]] = row[l];
                        paths[starts[row[l]] + rank[l]] = path_of[l];
                    }
            }
            count += is_leaf ? (lv)1 : (lv)0;
            // the next path: second halves that end here are left, and the last first half becomes a second one
            lv next = path + 1, zeros = popcount((next & -next) - 1);
            path = is_leaf ? next >> zeros : path;
            depth = is_leaf ? depth - zeros : depth;
            level = is_leaf ? (lv)0 : level;
            f = chosen_facet(is_leaf, whole, f);
            is_done |= is_leaf & ((depth < 0) | (path == 1));
        }
        // one cut further along the path, or beyond its end by first halves
        lv cuts = (is_leaf == 0) & (is_done == 0);
        lv grows = cuts & (is_within == 0);
        path = grows ? path << 1 : path;
        depth = grows ? depth + 1 : depth;
        lv too_deep = depth > MOST_CUTS;
        count = too_deep ? (lv)0 : count;
        is_done |= too_deep;
        lv shift = depth - 1 - level, is_second = ((path >> (shift < 0 ? (lv)0 : shift)) & 1) != 0;
        f = chosen_facet(cuts, half_of(f, is_second), f);
        level = cuts ? level + 1 : level;
    }
    long total[VW];
    STORE(count, 0, total);
    if (!given.listed)
#pragma unroll
        for (int l = 0; l < VW; l++)
            if (first + l < given.n_facets) counts[row[l]] = (int)total[l];
}

// Pieces number first + lane of the list, and their facets; those beyond the last are the last.
static inline facet load_piece(__global const double *restrict facets, __global const int *restrict owners,
                               __global const ulong *restrict paths, size_t first, int n, int *row) {
    long path_of[VW];
    int deepest = 0;
#pragma unroll
    for (int l = 0; l < VW; l++) {
        size_t j = min(first + l, (size_t)n - 1);
        row[l] = owners[j];
        path_of[l] = paths[j];
        deepest = max(deepest, 63 - (int)clz(paths[j]));
    }
    facet f = load_facet(facets, row);
    lv path = LOAD(0, path_of);
    // from the leading 1 down: cuts of shorter paths come last
    for (int shift = deepest - 1; shift >= 0; shift--) {
        lv reaches = (path >> (shift + 1)) > 0;
        f = chosen_facet(reaches, half_of(f, ((path >> shift) & 1) != 0), f);
    }
    return f;
}

// Corners of pieces, m, float64 (n, 3, 3). global size (n/VW, or more)
__kernel void piece_corners(int n, __global const double *restrict facets, __global const int *restrict owners,
                            __global const ulong *restrict paths, __global double *restrict corners) {
    int row[VW];
    size_t first = (size_t)get_global_id(0) * VW;
    facet f = load_piece(facets, owners, paths, first, n, row);
    double v[9][VW];
    STORE(f.a.x, 0, v[0]), STORE(f.a.y, 0, v[1]), STORE(f.a.z, 0, v[2]);
    STORE(f.b.x, 0, v[3]), STORE(f.b.y, 0, v[4]), STORE(f.b.z, 0, v[5]);
    STORE(f.c.x, 0, v[6]), STORE(f.c.y, 0, v[7]), STORE(f.c.z, 0, v[8]);
#pragma unroll
    for (int l = 0; l < VW; l++)
        if (first + l < n)
#pragma unroll
            for (int i = 0; i < 9; i++) corners[9 * (first + l) + i] = v[i][l];
}

// One step of splitmix64.
static inline uv mix(uv x) {
    x += (uv)0x9E3779B97F4A7C15UL;
    x = (x ^ (x >> 30)) * (uv)0xBF58476D1CE4E5B9UL;
    x = (x ^ (x >> 27)) * (uv)0x94D049BB133111EBUL;
    return x ^ (x >> 31);
}

// The number of 1e-6 m nearest a coordinate, |x| < 2e9 m: 1.5 * 2^52 leaves it in the low bits.
static inline uv micrometres(dv x) {
    return AS_WORD(sum_of(x * 1e6, (dv)ROUND)) - (uv)ROUND_BITS;
}

// (k + 1/2)/2^53 of the upper 53 bits of a word, rounded, within (0, 1)
static inline dv fraction(uv word) {
    dv high = AS_DOUBLE((uv)0x3FF0000000000000UL | (word >> 12)) - 1.0;
    dv low = AS_DOUBLE((uv)0x3FF0000000000000UL | ((word & (uv)0x800UL) << 40)) - 1.0;
    return high + (low * 2.220446049250313e-16 + 5.551115123125783e-17);
}

// log of 0 < u < 1, relative error < 2e-7: u = m 2^e, sqrt(1/2) < m < sqrt(2), log m = 2 artanh((m - 1)/(m + 1))
static inline fv log_of(dv u) {
    uv bits = AS_WORD(u) - (uv)0x3FE6A09E667F3BCDUL;  // less sqrt(1/2)
    dv m = AS_DOUBLE((bits & (uv)0x000FFFFFFFFFFFFFUL) + (uv)0x3FE6A09E667F3BCDUL);
    // e + 64 in the upper bits, which 2^52 turns to a number
    dv e = AS_DOUBLE((uv)0x4330000000000000UL | ((bits + (uv)0x0400000000000000UL) >> 52)) - 4503599627370560.0;
    fv f = TO_FLOAT(m - 1.0), s = f / (f + 2.0f), z = s * s;
    fv series = fma(z, fma(z, fma(z, fma(z, (fv)0.22222222f, (fv)0.28571429f), (fv)0.4f),
                               (fv)0.66666667f), (fv)2.0f);
    return fma(TO_FLOAT(e), (fv)0.69314718f, s * series);
}

// Two words of positions, in millionths of a metre, and of a stream's start.
static inline void hashes(uv start, uv x, uv y, uv z, uv *one, uv *two) {
    uv state = mix(mix(mix(start ^ x) ^ y) ^ z);
    *one = mix(state);
    *two = mix(state + (uv)0x9E3779B97F4A7C15UL);
}

// Standard normal numbers: in float32 for amplitudes, in float64 for heights, which may be many wavelengths.
static inline fv normal_number(uv start, uv x, uv y, uv z) {
    uv one, two;
    fv sine, cosine;
    hashes(start, x, y, z, &one, &two);
    sincos_cycles(TO_FLOAT(fraction(two) - 0.5), &sine, &cosine);
    return -cosine * sqrt(-2.0f * log_of(fraction(one)));
}
static inline dv wide_normal_number(uv start, uv x, uv y, uv z) {
    uv one, two;
    dv sine, cosine;
    hashes(start, x, y, z, &one, &two);
    sincos_double(fraction(two) - 0.5, &sine, &cosine);
    return -cosine * sqrt(-2.0 * log(fraction(one)));
}

typedef struct {
    int n, stride, n_kinds, n_surface, has_heights;
    ulong heights, real, imag;
} place_pieces_numbers;

// What kernels read of pieces. global size (stride/VW)
//   heights, real, imag   states from which the streams of random numbers start
//   surfaces  the reflectivity and the four numbers of roughness, 1/sqrt(eps), and the rms of heights where there are any
//   centers   float64 (3, stride), m
//   planes    float32 (8 + n_surface - has_heights, stride): as facet_amplitudes.cl reads them; edges 0 beyond the last piece
__kernel void place_pieces(place_pieces_numbers given, __global const double *restrict facets,
                           __global const int *restrict owners, __global const ulong *restrict paths,
                           __global const int *restrict kinds, __global const double *restrict surfaces,
                           __global double *restrict centers, __global float *restrict planes) {
    int row[VW];
    size_t at = get_global_id(0), first = at * VW, stride = given.stride;
    facet f = load_piece(facets, owners, paths, first, given.n, row);
    point x = {(f.a.x + f.b.x + f.c.x) / 3.0, (f.a.y + f.b.y + f.c.y) / 3.0, (f.a.z + f.b.z + f.c.z) / 3.0};
    f = from_longest(f);
    uv ix = micrometres(x.x), iy = micrometres(x.y), iz = micrometres(x.z);
    double surface[VW];
    float is_piece[VW];
    for (int i = 0; i < given.n_surface; i++) {
#pragma unroll
        for (int l = 0; l < VW; l++) surface[l] = surfaces[i * given.n_kinds + (given.n_kinds > 1 ? kinds[row[l]] : 0)];
        // behind the edges, and past the random numbers
        if (!given.has_heights || i < given.n_surface - 1)
            STORE(TO_FLOAT(LOAD(0, surface)), at, planes + (i < 5 ? 6 + i : 8 + i) * stride);
    }
    const float root_half = 0.70710678f;
    STORE(root_half * normal_number((uv)given.real, ix, iy, iz), at, planes + 11 * stride);
    STORE(root_half * normal_number((uv)given.imag, ix, iy, iz), at, planes + 12 * stride);
    // normals of needles: float32 resolves them if one of the two edges is the short one
    point one = minus(f.a, f.c), two = minus(f.b, f.c);
    if (given.has_heights) {
        point n = {one.y * two.z - one.z * two.y, one.z * two.x - one.x * two.z, one.x * two.y - one.y * two.x};
        dv step = wide_normal_number((uv)given.heights, ix, iy, iz) * LOAD(0, surface) / length_of(n);
        x.x += step * n.x;
        x.y += step * n.y;
        x.z += step * n.z;
    }
    STORE(x.x, at, centers);
    STORE(x.y, at, centers + stride);
    STORE(x.z, at, centers + 2 * stride);
#pragma unroll
    for (int l = 0; l < VW; l++) is_piece[l] = first + l < given.n;
    fv factor = LOAD(0, is_piece);
    STORE(factor * TO_FLOAT(one.x), at, planes);
    STORE(factor * TO_FLOAT(one.y), at, planes + stride);
    STORE(factor * TO_FLOAT(one.z), at, planes + 2 * stride);
    STORE(factor * TO_FLOAT(two.x), at, planes + 3 * stride);
    STORE(factor * TO_FLOAT(two.y), at, planes + 4 * stride);
    STORE(factor * TO_FLOAT(two.z), at, planes + 5 * stride);
}

static inline double least_lane(dv x) {
    double v[VW], m = INFINITY;
    STORE(x, 0, v);
#pragma unroll
    for (int l = 0; l < VW; l++) m = fmin(m, v[l]);
    return m;
}

typedef struct {
    int stride, per_tile, n_tiles;
    ulong x, y, z;
} tile_bounds_numbers;

// Middle of the box of each tile's centres, and distance of the farthest. global size (tiles, or more)
//   x, y, z  the scene's centre, m, float64
//   tiles    float64 (4, tiles): middle about that, radius, m
__kernel void tile_bounds(tile_bounds_numbers given, __global const double *restrict centers, __global double *restrict tiles) {
    size_t k = get_global_id(0), begin = k * (given.per_tile / VW), stride = given.stride;
    if (k >= given.n_tiles) return;
    dv low[3], high[3];
    for (int axis = 0; axis < 3; axis++) low[axis] = INFINITY, high[axis] = -INFINITY;
    for (size_t i = begin; i < begin + given.per_tile / VW; i++)
#pragma unroll
        for (int axis = 0; axis < 3; axis++) {
            dv v = LOAD(i, centers + axis * stride);
            low[axis] = v < low[axis] ? v : low[axis];
            high[axis] = v > high[axis] ? v : high[axis];
        }
    double middle[3];
#pragma unroll
    for (int axis = 0; axis < 3; axis++) middle[axis] = (least_lane(low[axis]) - least_lane(-high[axis])) * 0.5;
    dv most = 0;
    for (size_t i = begin; i < begin + given.per_tile / VW; i++) {
        point p = {LOAD(i, centers) - middle[0], LOAD(i, centers + stride) - middle[1],
                   LOAD(i, centers + 2 * stride) - middle[2]};
        dv squared = p.x * p.x + p.y * p.y + p.z * p.z;
        most = squared > most ? squared : most;
    }
    tiles[k] = middle[0] - as_double(given.x);
    tiles[given.n_tiles + k] = middle[1] - as_double(given.y);
    tiles[2 * given.n_tiles + k] = middle[2] - as_double(given.z);
    tiles[3 * given.n_tiles + k] = sqrt(-least_lane(-most));
}

// Offsets of centres from the middle of their tile, high parts, then low ones (2, 3, stride). global size (stride/VW)
__kernel void tile_offsets(tile_bounds_numbers given, __global const double *restrict centers,
                           __global const double *restrict tiles, __global float *restrict offsets) {
    size_t at = get_global_id(0), stride = given.stride;
    int k = min((int)(at * VW / given.per_tile), given.n_tiles - 1);
    double center[3] = {as_double(given.x), as_double(given.y), as_double(given.z)};
#pragma unroll
    for (int axis = 0; axis < 3; axis++) {
        dv off = (LOAD(at, centers + axis * stride) - center[axis]) - tiles[axis * given.n_tiles + k];
        fv high = TO_FLOAT(off);
        STORE(high, at, offsets + axis * stride);
        STORE(TO_FLOAT(off - TO_DOUBLE(high)), at, offsets + (3 + axis) * stride);
    }
}
