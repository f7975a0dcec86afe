// Which sample points of facets a viewpoint outside the scene sees: all lines of sight share an end, so facets are put
// into cells of a perspective view, and a facet is tested against those in the cells that it is seen in.
//
//   a sample is hidden where it lies in some occluder's shadow: inside the three planes through the eye and an edge, and
//   behind the occluder's own plane by more than `behind`. The last is tested before samples are lifted off their facet, so
//   that facets in one plane do not hide one another. On a line of samples each shadow is an interval: the planes'
//   distances change linearly from d_a + v (d_c - d_a) by (1 - v)(d_b - d_a), d_a, d_b, d_c those of the corners
//   u = D (x.across)/(D - x.toward),  v = D (x.upward)/(D - x.toward): the perspective view, D the distance of the eye
//
// source    Haines and Greenberg 1986, "The light buffer: a shadow-testing accelerator"
// symbols   x         from the middle of the scene, in units of the scene, at most about 1
//           toward    unit vector to the eye;  across, upward  unit vectors at right angles to it
//           facet, index, line, word   as in ray_casting.cl
//           occluder  (n, 9) corners
//           plane     (n, 4, 4): x of four normals, then y, z, and their offsets, of the planes of three edges and of the
//                     occluder; a point x is on the inner side of an edge, or behind the occluder, where normal.x - offset >= 0
//           entry     occluders, cell by cell: number, and the first of its cells, of the least column and row
//           top       (cells): largest x.toward of the occluders in a cell, plus 4, as the bits of a float
// macros    VW     lines of samples at once;  FP64  as in common.clh;  LINES  as in facet_points.clh
// numbers   float32 places points within 1e-7 of the scene; samples within SIDE of an edge of a shadow count as inside it,
//           so that facets that share an edge leave no gap
// reference: sarcl/reference/shadow.py:hidden

#include "common.clh"
#include "facet_points.clh"

#define SIDE 2e-7f
#define EDGE_ON_EYE 1e-6f  // sine, below which an occluder is seen edge-on and casts no shadow
#define OUTSIDE 1e30f      // offset of a plane that no point is inside of

static inline float3 crossing(float3 a, float3 b) {
    float3 c = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return c;
}

static inline float3 corner(__global const float *occluder, size_t i, int k) { return vload3(3 * i + k, occluder); }

static inline float4 through(float3 normal, float3 point) {
    float length = sqrt(inner(normal, normal));
    float4 out = {0, 0, 0, OUTSIDE};
    if (length > 0) {
        out.xyz = normal / length;
        out.w = inner(out.xyz, point);
    }
    return out;
}

// Plane of the edge from a to b and the eye, its inner side that of c.
static inline float4 edge_plane(float3 a, float3 b, float3 c, float3 eye) {
    float3 look = eye - a;
    float4 plane = through(crossing(b - a, look / sqrt(inner(look, look))), a);
    if (inner(plane.xyz, c) - plane.w < 0) plane = -plane;
    return plane;
}

typedef struct {
    float eye[3], other[3], across[3], upward[3], toward[3], distance, least[2], per_cell[2], behind;
    int cells[2];
} view_numbers;

// global size (occluders)
__kernel void shadow_planes(view_numbers given, __global const float *restrict occluder, __global float *restrict plane) {
    size_t i = get_global_id(0);
    float3 eye = vload3(0, given.eye), a = corner(occluder, i, 0), b = corner(occluder, i, 1), c = corner(occluder, i, 2);
    float3 look = eye - a;
    float4 own = through(crossing(b - a, c - a), a);
    float above = inner(own.xyz, look) / sqrt(inner(look, look));
    float4 one = edge_plane(a, b, c, eye), two = edge_plane(b, c, a, eye), three = edge_plane(c, a, b, eye);
    if (above > 0) own = -own;
    if (!(fabs(above) > EDGE_ON_EYE)) own.w = OUTSIDE;  // nothing is behind it
    vstore4((float4)(one.x, two.x, three.x, own.x), 4 * i, plane);
    vstore4((float4)(one.y, two.y, three.y, own.y), 4 * i + 1, plane);
    vstore4((float4)(one.z, two.z, three.z, own.z), 4 * i + 2, plane);
    vstore4((float4)(one.w, two.w, three.w, own.w), 4 * i + 3, plane);
}

typedef struct { float u, v, height; } seen_place;

static inline seen_place viewed(view_numbers given, float3 x) {
    seen_place out;
    out.height = inner(x, vload3(0, given.toward));
    float stretch = given.distance / (given.distance - out.height);
    out.u = (inner(x, vload3(0, given.across)) * stretch - given.least[0]) * given.per_cell[0];
    out.v = (inner(x, vload3(0, given.upward)) * stretch - given.least[1]) * given.per_cell[1];
    return out;
}

#if VW == 1
#define ANY(x) (x)
#else
#define ANY(x) any(x)
#endif
// lines of a work-item: as many as their bits fit into registers
#if VW == 1 && LINES > 16
#define ITEM_LINES 16
#else
#define ITEM_LINES LINES
#endif
#if LINES < VW
#define GROUPS 1
#define LINE(g) ((fv)inverses[0])
#define SHIFT(g) ((fv)inverses[LINES])
#else
#define GROUPS (ITEM_LINES / VW)
#define LINE(g) LOAD(g, inverses)
#define SHIFT(g) LOAD(g, inverses + LINES)
#endif

#define MARGIN 1e-3f  // of a cell, by which triangles are widened: above what rounding moves them by

#define CELL(u, v) ((u) << 16 | (v))

static inline int cell_of(float u, int cells) { return (int)clamp(u, 0.0f, cells - 1.0f); }

// Where a triangle is seen, in cells, and its least and largest height, plus 4.
typedef struct { float u_least, u_most, v_least, v_most, lowest, highest; } seen_box;

static inline seen_box box_of(view_numbers given, float3 p, float3 q, float3 r) {
    seen_box out;
    seen_place a = viewed(given, p), b = viewed(given, q), c = viewed(given, r);
    out.u_least = min(a.u, min(b.u, c.u)) - MARGIN;
    out.u_most = max(a.u, max(b.u, c.u)) + MARGIN;
    out.v_least = min(a.v, min(b.v, c.v)) - MARGIN;
    out.v_most = max(a.v, max(b.v, c.v)) + MARGIN;
    out.highest = max(a.height, max(b.height, c.height)) + 4.0f;
    out.lowest = min(a.height, min(b.height, c.height)) + 4.0f;
    return out;
}

static inline seen_box box_of_occluder(view_numbers given, __global const float *occluder, size_t i) {
    return box_of(given, corner(occluder, i, 0), corner(occluder, i, 1), corner(occluder, i, 2));
}

// Number of occluders in each cell, and their largest height. global size (occluders)
//   count  (cells), zeros before;  top  (cells), as above, zeros before
__kernel void count_cells(view_numbers given, __global const float *restrict occluder, __global int *restrict count,
                          __global int *restrict top) {
    size_t i = get_global_id(0);
    seen_box t = box_of_occluder(given, occluder, i);
    int height = as_int(t.highest), u_last = cell_of(t.u_most, given.cells[0]), v_last = cell_of(t.v_most, given.cells[1]);
    for (int v = cell_of(t.v_least, given.cells[1]); v <= v_last; v++)
        for (int u = cell_of(t.u_least, given.cells[0]); u <= u_last; u++) {
            atomic_inc(count + (size_t)v * given.cells[0] + u);
            atomic_max(top + (size_t)v * given.cells[0] + u, height);
        }
}

// Occluders of each cell, in any order. global size (occluders)
//   next  (cells): where each cell's entries begin, and after it where they end
__kernel void fill_cells(view_numbers given, __global const float *restrict occluder, __global int *restrict next,
                         __global int2 *restrict entry) {
    size_t i = get_global_id(0);
    seen_box t = box_of_occluder(given, occluder, i);
    int u_first = cell_of(t.u_least, given.cells[0]), v_first = cell_of(t.v_least, given.cells[1]);
    int u_last = cell_of(t.u_most, given.cells[0]), v_last = cell_of(t.v_most, given.cells[1]);
    int2 here = {i, CELL(u_first, v_first)};
    for (int v = v_first; v <= v_last; v++)
        for (int u = u_first; u <= u_last; u++) entry[atomic_inc(next + (size_t)v * given.cells[0] + u)] = here;
}

// Where a line of samples crosses a plane: at slope/(1 - v) + offset, in samples; the part above it (side 1), or below
// (side -1), is on the plane's inner side. side 0: the plane is parallel to the lines, and v at most `offset` on its inner
// side, or at least `offset` (slope -1)
typedef struct {
    float slope, offset;
    int side;
} crossed_plane;

// a, b, c: distances of the facet's corners;  least  on the inner side
static inline crossed_plane crossing_of(float a, float b, float c, float least) {
    crossed_plane out;
    float rise = b - a, along = c - a, start = least - a;
    out.side = rise > 0 ? 1 : rise < 0 ? -1 : 0;
    if (out.side) {  // (start - v along)/((1 - v) rise), and v/(1 - v) = 1/(1 - v) - 1
        float per_rise = PER_LINE / rise;
        out.offset = along * per_rise;
        out.slope = start * per_rise - out.offset;
    } else {
        out.slope = along < 0 ? 1.0f : -1.0f;
        out.offset = along != 0 ? start / along : start <= 0 ? -1.0f : 2.0f;
    }
    return out;
}

// The part of lines of samples that an occluder shades so far, in samples: from low to high.
typedef struct { fv low, high; } interval;

// inverse: 1/(1 - v) of the lines
static inline void cut_interval(interval *part, crossed_plane plane, fv inverse) {
    if (plane.side == 0) {
        fv v = 1 - 1 / inverse;
        part->high = plane.slope * v <= plane.slope * plane.offset ? part->high : (fv)-1;
        return;
    }
    fv at = plane.slope * inverse + plane.offset;
    if (plane.side > 0)
        part->low = at > part->low ? at : part->low;
    else
        part->high = at < part->high ? at : part->high;
}

// Bits of the samples of an interval, on lines whose samples are shifted; none where it is empty.
static inline iv samples_in(interval part, fv shift) {
    iv first = nearest_int((part.low < PER_LINE ? part.low : (fv)PER_LINE) - shift);
    iv last = nearest_int((part.high > 0 ? part.high : (fv)0) - shift);
    return ((iv)-1 << (first & 31)) & ~((iv)-2 << ((last - 1) & 31)) & (first - last) >> 31;
}

// Distances of a point from four planes.
static inline float4 distances(__global const float *plane, float3 x) {
    return vload4(0, plane) * x.x + vload4(1, plane) * x.y + vload4(2, plane) * x.z - vload4(3, plane);
}

static inline int any_below(float4 d, float4 least) {
    int4 below = d < least;
    return (below.x | below.y | below.z | below.w) != 0;
}

// Sets the bits of samples in shadow. global size (facets, LINES / ITEM_LINES)
//   inverses  (2, LINES): 1/(1 - v) of the lines, and shifts of their samples;  end  (cells): where each cell's entries end
__kernel void shaded(view_numbers given, __global const float *restrict facet, __global const int *restrict index,
                     __global const float *restrict inverses, __global const float *restrict plane,
                     __global const int *restrict end, __global const int *restrict top, __global const int2 *restrict entry,
                     __global int *restrict word) {
    size_t i = get_global_id(0);
    word += i * LINES;
    if (all_hidden(word)) return;
    word += get_global_id(1) * ITEM_LINES;
    inverses += get_global_id(1) * ITEM_LINES;
    __global const float *f = facet + 12 * (size_t)index[i];
    float3 eye = vload3(0, given.eye), other = vload3(0, given.other);
    if (is_behind(f, eye, other)) return;
    float3 corner = {f[0], f[1], f[2]}, p = lifted(f, (float2)(0), eye, other);
    float3 q = p + (float3)(f[3], f[4], f[5]), r = p + (float3)(f[6], f[7], f[8]), lift = p - corner;
    seen_box t = box_of(given, p, q, r);
    if (!(t.u_most >= 0 && t.v_most >= 0 && t.u_least <= given.cells[0] && t.v_least <= given.cells[1])) return;  // beside all
    // distances from which on a sample is in shadow, a corner of the facet not in the light, and a corner in deep shadow
    const float4 least = {-SIDE, -SIDE, -SIDE, given.behind}, touching = {-SIDE, -SIDE, -SIDE, -given.behind};
    const float4 deep = {SIDE, SIDE, SIDE, given.behind};
    int changed = 0, dark = 0, corners = 0, shaded = 0;
    iv bits[GROUPS];
#pragma unroll
    for (int g = 0; g < GROUPS; g++) bits[g] = 0;
    int u_first = cell_of(t.u_least, given.cells[0]), u_last = cell_of(t.u_most, given.cells[0]);
    int v_first = cell_of(t.v_least, given.cells[1]), v_last = cell_of(t.v_most, given.cells[1]);
    for (int v = v_first; v <= v_last && !dark; v++)
        for (int u = u_first; u <= u_last && !dark; u++) {
            int cell = v * given.cells[0] + u;
            if (t.lowest >= as_float(top[cell])) continue;
            for (int k = cell ? end[cell - 1] : 0; k < end[cell] && !dark; k++) {
                int at = entry[k].x, of = entry[k].y;
                // of the cells that hold both, the first counts
                if (u != max(u_first, of >> 16) || v != max(v_first, of & 0xFFFF)) continue;
                __global const float *o = plane + 16 * (size_t)at;
                // the occluder's own plane lies behind the facet before it is lifted
                float4 d_a = distances(o, p), d_b = distances(o, q), d_c = distances(o, r);
                float drop = o[3] * lift.x + o[7] * lift.y + o[11] * lift.z;
                d_a.w -= drop;
                d_b.w -= drop;
                d_c.w -= drop;
                if (any_below(max(d_a, max(d_b, d_c)), least)) continue;
                changed = 1;
                int unlit = !any_below(d_a, touching) | !any_below(d_b, touching) << 1 | !any_below(d_c, touching) << 2;
                corners |= unlit;
                dark = unlit == 7;
                shaded |= !any_below(d_a, deep) | !any_below(d_b, deep) | !any_below(d_c, deep);
                if (dark) break;
                crossed_plane one = crossing_of(d_a.x, d_b.x, d_c.x, -SIDE), two = crossing_of(d_a.y, d_b.y, d_c.y, -SIDE);
                crossed_plane three = crossing_of(d_a.z, d_b.z, d_c.z, -SIDE), own = crossing_of(d_a.w, d_b.w, d_c.w, given.behind);
                iv all = -1;
#pragma unroll
                for (int g = 0; g < GROUPS; g++) {
                    fv inverse = LINE(g);
                    interval part = {0, PER_LINE};
                    cut_interval(&part, one, inverse);
                    cut_interval(&part, two, inverse);
                    cut_interval(&part, three, inverse);
                    cut_interval(&part, own, inverse);
                    bits[g] |= samples_in(part, SHIFT(g));
                    all &= bits[g];
                }
                dark = corners == 7 && !ANY(all != (iv)-1);
            }
        }
    if (!changed) return;
#if LINES > 1
    // slivers that no line of samples meets: a facet with a shaded corner is not whole, and with one that is lit not dark
    iv either = 0, both = -1, one = LINE(0) == inverses[0] ? (iv)1 : (iv)0;
#pragma unroll
    for (int g = 0; g < GROUPS; g++) {
        either |= bits[g];
        both &= bits[g];
    }
    int sliver = !dark && get_global_id(1) == 0;
    if (sliver && shaded && !ANY(either != (iv)0)) bits[0] |= one;
    if (sliver && !ANY(both != (iv)-1)) bits[0] &= ~one;
#endif
#pragma unroll
    for (int g = 0; g < GROUPS; g++) {
        iv hidden = dark ? (iv)-1 : bits[g];
#if LINES < VW
        word[0] |= hidden.s0;
#else
        STORE(LOAD(g, word) | hidden, g, word);
#endif
    }
}
