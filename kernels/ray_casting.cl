// Which sample points of facets a viewpoint sees: rays through a tree of boxes.
//
//   a sample is hidden where some facet crosses the line from it to the eye; one ray decides on `step` samples
//
// source    box_tree.clh: watertight, so facets that share an edge leave no gap
// symbols   facet     (n, 12), see facet_points.clh; the lift keeps a facet, its coplanar neighbours and its twin from hiding it
//           index     facets to test, (size,); line (LINES,) places of the lines of samples;  word  as in facet_points.clh
//           eye       the antenna, in units of the scene; shrink  a power of two that makes eye - p about one
//           other     the other antenna, as facet_points.clh takes it
//           leaf, node, base  the tree, as in box_tree.clh
//           kind      bits: 1: the facet turned away from the eye is dark;  2: ALL_SAMPLES
//           slack     rad, by which a facet must be turned away from the eye at least to count as turned away
// macros    LINES  as in facet_points.clh
// reference: sarcl/reference/shadow.py:hidden

#include "box_tree.clh"
#include "facet_points.clh"

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
    int step, depth, probe;  // probe 1: four probes decide where they agree; they miss narrow shadows
} hidden_numbers;

__kernel void hidden(hidden_numbers given, __global const float *restrict facet, __global const int *restrict index,
                     __global const uchar *restrict kind, __global const float *restrict line,
                     __global const float *restrict leaf, __global const float *restrict node,
                     __constant const int *restrict base, __global int *restrict word) {
    size_t i = get_global_id(0);
    __global const float *f = facet + 12 * (size_t)index[i];
    float3 eye = vload3(0, given.eye), other = vload3(0, given.other);
    int dark = 0, probed = given.probe && !(kind[index[i]] & ALL_SAMPLES);
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
