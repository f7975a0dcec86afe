// Which sample points of facets a viewpoint sees: rays through a tree of boxes.
//
//   a sample is hidden where some facet crosses the line from it to the eye; one ray decides on `step` samples
//
// source    ray and triangle: Woop, Benthin and Wald 2013 (watertight: facets that share an edge leave no gap), here
//           without its division: with d = eye - p and A, B, C the corners seen from p, sheared so that d is the axis,
//           U = Cx By - Cy Bx, ... have one sign, and the crossing at p + t d has t = (U Az + V Bz + W Cz)/(det dz)
// symbols   facet     (n, 12), see facet_points.clh; the lift keeps a facet, its coplanar neighbours and its twin from hiding it
//           index     facets to test, (size,); line (LINES,) places of the lines of samples;  word  as in facet_points.clh
//           eye       the antenna, in units of the scene; shrink  a power of two that makes eye - p about one
//           other     the other antenna, as facet_points.clh takes it
//           leaf      (n/8, 3, 3, 8): corners of eight facets, by corner and axis
//           node      (., 2, 3, 8): lower and upper sides of the boxes of eight children; level l starts at base[l]
//           kind      bits: 1: the facet turned away from the eye is dark;  2: ALL_SAMPLES
//           slack     rad, by which a facet must be turned away from the eye at least to count as turned away
//           d, z      eye - p times `shrink`, and the axis of its largest component; A, B, C are sheared along it
// macros    LINES  as in facet_points.clh
// reference: sarcl/reference/shadow.py:hidden

#include "facet_points.clh"

static inline int any_bits(int8 m, int8 value) {
    int8 b = m & value;
    int4 c = b.lo | b.hi;
    return c.s0 | c.s1 | c.s2 | c.s3;
}

#define BITS ((int8)(1, 2, 4, 8, 16, 32, 64, 128))

// Eight numbers of a node or a leaf, which are whole multiples of 16 bytes: vload8 promises the alignment of one number
// alone, and GPUs would load each by itself.
typedef float8 __attribute__((aligned(16))) aligned_float8;

static inline float8 eight(int k, __global const float *p) { return ((__global const aligned_float8 *)p)[k]; }

// children of a node whose boxes, a little enlarged on the host, the ray touches
static inline int touched(__global const float *node, float3 p, float3 inverse) {
    float8 ax = (eight(0, node) - p.x) * inverse.x, bx = (eight(3, node) - p.x) * inverse.x;
    float8 ay = (eight(1, node) - p.y) * inverse.y, by = (eight(4, node) - p.y) * inverse.y;
    float8 az = (eight(2, node) - p.z) * inverse.z, bz = (eight(5, node) - p.z) * inverse.z;
    float8 in = fmax(fmax(fmin(ax, bx), fmin(ay, by)), fmin(az, bz));
    float8 out = fmin(fmin(fmax(ax, bx), fmax(ay, by)), fmax(az, bz));
    return any_bits((in <= out) & (out >= 0.0f), BITS);
}

// does any of eight facets cross the line from p along d, before the eye?
static inline int crossed(__global const float *leaf, float3 p, float3 d, int z, float shrink) {
    int x = z == 2 ? 0 : z + 1, y = x == 2 ? 0 : x + 1;
    float px = x == 0 ? p.x : x == 1 ? p.y : p.z, py = y == 0 ? p.x : y == 1 ? p.y : p.z;
    float pz = z == 0 ? p.x : z == 1 ? p.y : p.z, dx = x == 0 ? d.x : x == 1 ? d.y : d.z;
    float dy = y == 0 ? d.x : y == 1 ? d.y : d.z, dz = z == 0 ? d.x : z == 1 ? d.y : d.z;
    float8 az = eight(z, leaf) - pz, bz = eight(3 + z, leaf) - pz, cz = eight(6 + z, leaf) - pz;
    float8 ax = (eight(x, leaf) - px) * dz - az * dx, ay = (eight(y, leaf) - py) * dz - az * dy;
    float8 bx = (eight(3 + x, leaf) - px) * dz - bz * dx, by = (eight(3 + y, leaf) - py) * dz - bz * dy;
    float8 cx = (eight(6 + x, leaf) - px) * dz - cz * dx, cy = (eight(6 + y, leaf) - py) * dz - cz * dy;
    float8 u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    int8 inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0));
    float8 det = (u + v + w) * dz, t = u * az + v * bz + w * cz;
    int8 ahead = ((t > 0) & (det > 0) & (t * shrink < det)) | ((t < 0) & (det < 0) & (t * shrink > det));
    return any_bits(inside & ahead, (int8)(1));
}

static inline int blocked(__global const float *leaf, __global const float *node, __constant const int *base, int depth,
                          float3 p, float3 eye, float shrink) {
    float3 d = (eye - p) * shrink, size = fabs(d);
    int z = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    // a ray along a wall of boxes: large, not infinite, so that zero times it is zero
    float3 inverse;
    inverse.x = 1 / (size.x < 1e-12f ? 1e-12f : d.x);
    inverse.y = 1 / (size.y < 1e-12f ? 1e-12f : d.y);
    inverse.z = 1 / (size.z < 1e-12f ? 1e-12f : d.z);
    // Children to be visited, a bit each: those of this level in the lowest byte, those of the level above in the next,
    // 16 levels in all. An array indexed by the level would lie in memory on GPUs.
    ulong todo = touched(node, p, inverse), above = 0;
    int level = 0, at = 0;
    while (level >= 0) {
        int here = (int)(todo & 255);
        if (!here) {
            level--;
            at >>= 3;
            todo = todo >> 8 | above << 56;
            above >>= 8;
            continue;
        }
        int child = 31 - clz(here);
        todo ^= 1UL << child;
        int next = 8 * at + child;
        if (level == depth - 1) {
            if (crossed(leaf + 72 * (size_t)next, p, d, z, shrink)) return 1;
        } else {
            level++;
            at = next;
            above = above << 8 | todo >> 56;
            todo = todo << 8 | (ulong)touched(node + 48 * ((size_t)base[level] + at), p, inverse);
        }
    }
    return 0;
}

typedef struct {
    float eye[3], slack;
    int fresh;
} face_numbers;

// Facets turned away start with every sample hidden, the others with none (fresh 1) or as they are (fresh 0).
__kernel void face(face_numbers given, __global const float *restrict facet, __global const int *restrict index,
                   __global const uchar *restrict kind, __global int *restrict word) {
    size_t i = get_global_id(0);
    __global const float *f = facet + 12 * (size_t)index[i];
    float3 ahead = vload3(0, given.eye) - (float3)(f[0], f[1], f[2]);
    float above = f[9] * ahead.x + f[10] * ahead.y + f[11] * ahead.z;
    float lift = f[9] * f[9] + f[10] * f[10] + f[11] * f[11];
    float far = ahead.x * ahead.x + ahead.y * ahead.y + ahead.z * ahead.z;
    int away = (kind[index[i]] & 1) && above < 0 && above * above > given.slack * given.slack * lift * far;
    word += i * LINES;
    if (!away && !given.fresh) return;
    for (int l = 0; l < LINES; l++) word[l] = away ? -1 : 0;
}

typedef struct {
    float eye[3], other[3], shrink;
    int step, depth;
} hidden_numbers;

__kernel void hidden(hidden_numbers given, __global const float *restrict facet, __global const int *restrict index,
                     __global const uchar *restrict kind, __global const float *restrict line,
                     __global const float *restrict leaf, __global const float *restrict node,
                     __constant const int *restrict base, __global int *restrict word) {
    size_t i = get_global_id(0);
    __global const float *f = facet + 12 * (size_t)index[i];
    float3 eye = vload3(0, given.eye), other = vload3(0, given.other);
    int dark = 0, probed = !(kind[index[i]] & ALL_SAMPLES);
    word += i * LINES;
    if (all_hidden(word)) return;
    for (int s = probed ? -PROBES : 0; s < LINES * PER_LINE; s += s < 0 ? 1 : given.step) {
        if (s == 0 && probed && dark == 0) return;
        int l = max(s, 0) / PER_LINE, bit = max(s, 0) % PER_LINE, some = some_samples(bit, given.step);
        if (s == 0 && dark == PROBES) {
            for (int k = 0; k < LINES; k++) word[k] = -1;
            return;
        }
        if (s >= 0 && (word[l] & some) == some) continue;
        float2 at = s < 0 ? probe_at(s + PROBES) : sample_at(line[l], bit + 0.5f * (given.step - 1));
        float3 p = lifted(f, at, eye, other);
        if (!blocked(leaf, node, base, given.depth, p, eye, given.shrink)) continue;
        if (s < 0)
            dark++;
        else
            word[l] |= some;
    }
}

// Numbers of samples of each facet that are not hidden, on lines 0, 3, 4, 7, 8 ... and on 1, 2, 5, 6, 9 ...
//   out  (n, 2)
__kernel void seen(__global const int *restrict word, __global ushort *restrict out) {
    size_t i = get_global_id(0);
    int one = 0, two = 0;
    for (int l = 0; l < LINES; l++) {
        int n = popcount((uint)~word[i * LINES + l]), odd = ((l + 1) >> 1) & 1;
        one += odd ? 0 : n;
        two += odd ? n : 0;
    }
    out[2 * i] = one;
    out[2 * i + 1] = two;
}
