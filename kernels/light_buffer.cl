// Which sample points of facets a viewpoint outside the scene sees: all lines of sight share an end, so facets are put
// into cells of a perspective view, and a sample is tested against those of its own cell alone.
//
//   bit s of hidden_i = 1 where sample s of facet i lies in some occluder's shadow: inside the three planes through the
//   eye and an edge, and behind the occluder's own plane by more than BEHIND. The last is tested at the sample before it
//   is lifted off its facet, so that facets in one plane do not hide one another
//   u = D (x.across)/(D - x.toward),  v = D (x.upward)/(D - x.toward): the perspective view, D the distance of the eye
//
// source    Haines and Greenberg 1986, "The light buffer: a shadow-testing accelerator"
// symbols   x         from the middle of the scene, in units of the scene, at most about 1
//           toward    unit vector to the eye;  across, upward  unit vectors at right angles to it
//           facet, index, place, hidden   as in ray_casting.cl
//           occluder  (n, 9) corners
//           plane     (n, 16): normals (x, y, z) and offsets of the planes of three edges and of the occluder; a point x is
//                     on the inner side of an edge, and on the eye's side of the occluder, where normal.x - offset >= 0
//           first     (cells + 1): where each cell's entries begin;  entry  occluders, cell by cell
//           top       (cells): largest x.toward of the occluders in a cell, plus 4, as the bits of a float
// macros    none
// numbers   float32 places points within 1e-7 of the scene; samples within SIDE of an edge of a shadow count as inside it,
//           so that facets that share an edge leave no gap
// reference: sarcl/reference/shadow.py:hidden

#include "facet_points.clh"

#define SIDE 2e-7f
#define BEHIND 2e-6f  // a facet, its coplanar neighbours and its twin do not hide it, from whatever side they are seen
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
    float eye[3], other[3], across[3], upward[3], toward[3], distance, least[2], per_cell[2];
    int cells[2], samples;
} view_numbers;

// global size (occluders)
__kernel void shadow_planes(view_numbers given, __global const float *restrict occluder, __global float *restrict plane) {
    size_t i = get_global_id(0);
    float3 eye = vload3(0, given.eye), a = corner(occluder, i, 0), b = corner(occluder, i, 1), c = corner(occluder, i, 2);
    float3 look = eye - a;
    float4 own = through(crossing(b - a, c - a), a);
    float above = inner(own.xyz, look) / sqrt(inner(look, look));
    vstore4(edge_plane(a, b, c, eye), 4 * i, plane);
    vstore4(edge_plane(b, c, a, eye), 4 * i + 1, plane);
    vstore4(edge_plane(c, a, b, eye), 4 * i + 2, plane);
    if (above < 0) own = -own;
    if (!(fabs(above) > EDGE_ON_EYE)) own.w = -OUTSIDE;  // nothing is behind it
    vstore4(own, 4 * i + 3, plane);
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

#define MARGIN 1e-3f  // of a cell, by which triangles are widened: above what rounding moves them by

static inline int cell_of(float u, int cells) { return (int)clamp(u, 0.0f, cells - 1.0f); }

static inline float apart(seen_place a, seen_place b, float u, float v) { return (b.u - a.u) * (v - a.v) - (b.v - a.v) * (u - a.u); }

// Whether a cell lies wholly beyond the edge from a to b of a triangle whose third corner is on the side of sign `turn`.
static inline int beyond(seen_place a, seen_place b, float turn, float u, float v) {
    float du = turn * (b.v - a.v), dv = -turn * (b.u - a.u);  // the largest value is at one corner of the cell
    float u_most = du > 0 ? u - MARGIN : u + 1 + MARGIN, v_most = dv > 0 ? v - MARGIN : v + 1 + MARGIN;
    return turn * apart(a, b, u_most, v_most) < 0;
}

// An occluder as it is seen, and the cells from first to last that may hold it.
typedef struct {
    seen_place a, b, c;
    float turn;
    int u_first, u_last, v_first, v_last;
} seen_triangle;

static inline seen_triangle viewed_triangle(view_numbers given, __global const float *occluder, size_t i) {
    seen_triangle out;
    seen_place a = viewed(given, corner(occluder, i, 0)), b = viewed(given, corner(occluder, i, 1));
    seen_place c = viewed(given, corner(occluder, i, 2));
    out.a = a;
    out.b = b;
    out.c = c;
    out.turn = apart(a, b, c.u, c.v) < 0 ? -1.0f : 1.0f;
    out.u_first = cell_of(min(a.u, min(b.u, c.u)) - MARGIN, given.cells[0]);
    out.u_last = cell_of(max(a.u, max(b.u, c.u)) + MARGIN, given.cells[0]);
    out.v_first = cell_of(min(a.v, min(b.v, c.v)) - MARGIN, given.cells[1]);
    out.v_last = cell_of(max(a.v, max(b.v, c.v)) + MARGIN, given.cells[1]);
    return out;
}

static inline int holds(seen_triangle t, int u, int v) {
    return !beyond(t.a, t.b, t.turn, u, v) && !beyond(t.b, t.c, t.turn, u, v) && !beyond(t.c, t.a, t.turn, u, v);
}

// Number of occluders in each cell, and their largest height. global size (occluders)
//   count  (cells), zeros before;  top  (cells), as above, zeros before
__kernel void count_cells(view_numbers given, __global const float *restrict occluder, __global int *restrict count,
                          __global int *restrict top) {
    size_t i = get_global_id(0);
    seen_triangle t = viewed_triangle(given, occluder, i);
    int height = as_int(max(t.a.height, max(t.b.height, t.c.height)) + 4.0f);
    for (int v = t.v_first; v <= t.v_last; v++)
        for (int u = t.u_first; u <= t.u_last; u++)
            if (holds(t, u, v)) {
                atomic_inc(count + (size_t)v * given.cells[0] + u);
                atomic_max(top + (size_t)v * given.cells[0] + u, height);
            }
}

// Occluders of each cell, in any order. global size (occluders)
//   next  (cells): where each cell's entries begin, and after it where they end
__kernel void fill_cells(view_numbers given, __global const float *restrict occluder, __global int *restrict next,
                         __global int *restrict entry) {
    size_t i = get_global_id(0);
    seen_triangle t = viewed_triangle(given, occluder, i);
    for (int v = t.v_first; v <= t.v_last; v++)
        for (int u = t.u_first; u <= t.u_last; u++)
            if (holds(t, u, v)) entry[atomic_inc(next + (size_t)v * given.cells[0] + u)] = i;
}

static inline float beside(__global const float *plane, int k, float3 x) {
    float4 p = vload4(k, plane);
    return inner(p.xyz, x) - p.w;
}

// Sets the bits of samples in shadow. global size (facets)
//   end  (cells): where each cell's entries end
__kernel void shaded(view_numbers given, __global const float *restrict facet, __global const int *restrict index,
                     __global const float2 *restrict place, __global const float *restrict plane,
                     __global const int *restrict end, __global const int *restrict top, __global const int *restrict entry,
                     __global ulong *restrict out) {
    size_t i = get_global_id(0);
    __global const float *f = facet + 12 * (size_t)index[i];
    float3 eye = vload3(0, given.eye), other = vload3(0, given.other);
    ulong bits = out[i];
    for (int s = 0; s < given.samples; s++) {
        if (bits >> s & 1) continue;
        float2 at = place[s];
        float3 x = lifted(f, at, eye, other);
        float3 own = {f[0] + at.x * f[3] + at.y * f[6], f[1] + at.x * f[4] + at.y * f[7], f[2] + at.x * f[5] + at.y * f[8]};
        seen_place seen = viewed(given, x);
        if (!(seen.u >= -MARGIN && seen.v >= -MARGIN && seen.u <= given.cells[0] + MARGIN && seen.v <= given.cells[1] + MARGIN))
            continue;  // beside all occluders
        int cell = cell_of(seen.v, given.cells[1]) * given.cells[0] + cell_of(seen.u, given.cells[0]);
        if (seen.height + 4.0f >= as_float(top[cell])) continue;
        for (int k = cell ? end[cell - 1] : 0; k < end[cell]; k++) {
            __global const float *p = plane + 16 * (size_t)entry[k];
            if (beside(p, 3, own) < -BEHIND && beside(p, 0, x) >= -SIDE && beside(p, 1, x) >= -SIDE && beside(p, 2, x) >= -SIDE) {
                bits |= 1UL << s;
                break;
            }
        }
    }
    out[i] = bits;
}
