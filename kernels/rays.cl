// Rays between facets: the first facet on a line, and whether there is any.
//
//   both ends of a line lie inside of the scene's sphere, and off the facets that it leaves and reaches; nearest: the
//   children of a node are visited from the line's beginning on, and no box behind the facet that is found
//
// source    box_tree.clh: watertight, so facets that share an edge leave no gap
// symbols   ray       (n, 6): both ends of a line, in units of the scene
//           leaf, node, base, depth  the tree, as in box_tree.clh
//           found     (n,): the facet, by its place in the tree; -1 for none.  hit (n,): 1 where there is one
// macros    none
// reference: sarcl/reference/rays.py:nearest

#include "box_tree.clh"

static inline float least(float8 x) {
    float4 a = min(x.lo, x.hi);
    return min(min(a.s0, a.s1), min(a.s2, a.s3));
}

__kernel void nearest(int depth, __global const float *restrict ray, __global const float *restrict leaf,
                      __global const float *restrict node, __constant const int *restrict base,
                      __global int *restrict found) {
    size_t i = get_global_id(0);
    line r = between(vload3(2 * i, ray), vload3(2 * i + 1, ray), 1.0f);
    // Children are sorted along a curve, on which x, y, z go up in turn (_box_tree.py): those that the line is likely to
    // meet first come first, from the highest bit down.
    int turned = (r.d.x < 0 ? 1 : 0) | (r.d.y < 0 ? 2 : 0) | (r.d.z < 0 ? 4 : 0);
    int8 bits = (int8)(1) << ((int8)(7, 6, 5, 4, 3, 2, 1, 0) ^ turned);
    float best = 1;
    int facet = -1;
    visit v = {255, 0, 0, 0};
    int look = 1;
    while (v.level >= 0) {
        // children that the line touches before the facet that is found: anew for each node that is come back to
        if (look) v.todo &= ~255UL | (ulong)touched(node + 48 * ((size_t)base[v.level] + v.at), r, best, bits);
        int here = (int)(v.todo & 255);
        if (!here) {
            v = up(v);
            look = v.level >= 0 && (v.todo & 255) && facet >= 0;
            continue;
        }
        int bit = 31 - clz(here), next = 8 * v.at + ((7 - bit) ^ turned);
        v.todo ^= 1UL << bit;
        look = v.level < depth - 1;
        if (look) {
            v = down(v, next, 255);
            continue;
        }
        float8 t, det;
        int8 ahead = met(leaf + 72 * (size_t)next, r, &t, &det);
        t = ahead ? t / det : (float8)INFINITY;
        float nearer = least(t);
        if (nearer < best) {
            best = nearer;
            facet = 8 * next + 31 - clz(any_bits(t == nearer, BITS));
        }
    }
    found[i] = facet;
}

__kernel void any_hit(int depth, __global const float *restrict ray, __global const float *restrict leaf,
                      __global const float *restrict node, __constant const int *restrict base,
                      __global uchar *restrict hit) {
    size_t i = get_global_id(0);
    hit[i] = blocked(leaf, node, base, depth, vload3(2 * i, ray), vload3(2 * i + 1, ray), 1.0f);
}
