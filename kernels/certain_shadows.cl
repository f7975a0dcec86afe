// Which shadows certainly miss a facet, or cover all of it, whatever antenna of several casts them.
//
//   w(e, x) = ((b - a) x (e - a)).(x - a),   0 where x lies in the plane through an antenna e and an edge from a to b
//
// w is linear in e and linear in x. Where it has one sign at the corners of a box of antennas and at the corners of a facet,
// it has that sign for all antennas in the box and all points of the facet.
//   missed    all of one lies beyond some edge of the other, or within `slack` of it
//   covered   the facet lies on the inner side of all edges of the occluder, and behind it. Lines of sight then meet the
//             occluder above the facet's plane, whether or not other parts of it reach below that
//
// source    docs/theory/shadows.md; as separating axes of convex polygons (Gottschalk, Lin and Manocha 1996), in perspective
// symbols   receiver, slack, on_plane   see receiver_axes.clh;  eye  a corner of a box of antennas, m
// macros    ENDS   boxes: 1 of a monostatic antenna, 2 of a transmitter and of a receiver
// numbers   float64, as in lit_parts.cl
// reference: sarcl/reference/certain_shadows.py:certain_shadow

#include "receiver_axes.clh"

enum { MISSED = 0, UNDECIDED = 1, COVERED = 2 };
// Of `slack`: distance from an edge's plane within which places count as in it
#define IN_PLANE 0.1
#define LEAST_HEIGHT 1e-6  // sine of an antenna's elevation over the facet, as in lit_parts.cl
#define MOST_HEIGHT 0.99   // of an occluder that covers the facet, over the antenna's

static inline place minus(place a, place b) {
    place out = {a.x - b.x, a.y - b.y, a.z - b.z};
    return out;
}

static inline double dot3(place a, place b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static inline place cross3(place a, place b) {
    place out = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return out;
}

static inline place eye_at(__global const double *r, __global const double *eye) {
    double x = eye[0] - r[0], y = eye[1] - r[1], z = eye[2] - r[2];
    place out = {x * r[3] + y * r[4] + z * r[5], x * r[6] + y * r[7] + z * r[8], x * r[9] + y * r[10] + z * r[11]};
    return out;
}

// Bits: 1 where three places all lie beyond the edge from a to b of a triangle that antennas see anticlockwise (sign 1) or
// clockwise (-1), 2 where all lie on its inner side.
static inline int sides(place a, place b, __global const double *r, __global const double *eyes, int n_eyes, int sign,
                        const place *others, double margin) {
    place along = minus(b, a);
    int beyond = 1, inner = 2;
    for (int k = 0; k < n_eyes; k++) {
        place normal = cross3(along, minus(eye_at(r, eyes + 3 * k), a));
        double most = margin * sqrt(dot3(normal, normal));
#pragma unroll
        for (int j = 0; j < 3; j++) {
            double inside = -sign * dot3(normal, minus(others[j], a));
            beyond = inside <= most ? beyond : 0;
            inner = inside >= 0 ? inner : 0;
        }
    }
    return beyond | inner;
}

typedef struct { int n_eyes; } certain_shadows_numbers;

// global size (pairs)
//   receivers  (n, RECEIVER);  pair_receiver, pair_occluder (pairs);  occluders (., 9)   corners, m
//   eyes       (ENDS, n_eyes, 3)   m
//   state      (pairs)   UNDECIDED, MISSED from all antennas, or COVERED from those of one box
__kernel void certain_shadows(certain_shadows_numbers given, __global const double *restrict receivers,
                              __global const int *restrict pair_receiver, __global const int *restrict pair_occluder,
                              __global const double *restrict occluders, __global const double *restrict eyes,
                              __global uchar *restrict state) {
    size_t pair = get_global_id(0);
    __global const double *r = receivers + RECEIVER * (size_t)pair_receiver[pair];
    __global const double *o = occluders + 9 * (size_t)pair_occluder[pair];
    int missed = 1, covered = 0, first_side = 0;
    double margin = IN_PLANE * r[19];
    place facet[3], solid[3];
#pragma unroll
    for (int i = 0; i < 3; i++) {
        place corner = {r[12 + 2 * i], r[13 + 2 * i], 0};
        facet[i] = corner;
        solid[i] = in_axes(r, o[3 * i], o[3 * i + 1], o[3 * i + 2], 1);
    }
    place normal = cross3(minus(solid[1], solid[0]), minus(solid[2], solid[0]));
    for (int e = 0; e < ENDS; e++) {
        __global const double *box = eyes + 3 * e * given.n_eyes;
        double lowest = INFINITY;
        int above = 1, over = 1, under = 1, before = 1, behind = 1;
        for (int k = 0; k < given.n_eyes; k++) {
            place here = eye_at(r, box + 3 * k);
            double ahead = dot3(normal, minus(here, solid[0]));
            over &= here.z > 0;
            under &= here.z < 0;
            before &= ahead > 0;
            behind &= ahead < 0;
            lowest = min(lowest, fabs(here.z));
            above &= fabs(here.z) > LEAST_HEIGHT * sqrt(dot3(here, here));
        }
        // 1 or -1 where all antennas are on one side of the facet's plane, of the occluder's; else 0
        int side = over - under, facing = before - behind, apart = 0, within = 2;
#pragma unroll
        for (int i = 0; i < 3; i++) {
            int next = i == 2 ? 0 : i + 1;
            int found = facing ? sides(solid[i], solid[next], r, box, given.n_eyes, facing, facet, margin) : 0;
            apart |= found & 1;
            within &= found;
        }
        if (side && !apart) {
#pragma unroll
            for (int i = 0; i < 3; i++) {
                int next = i == 2 ? 0 : i + 1;
                apart |= sides(facet[i], facet[next], r, box, given.n_eyes, side, solid, margin) & 1;
            }
        }
        missed &= apart;
        int covers = side && above && within;
        double highest = max(side * solid[0].z, max(side * solid[1].z, side * solid[2].z));
#pragma unroll
        for (int i = 0; i < 3; i++) covers &= facing * dot3(normal, minus(facet[i], solid[0])) <= 0;
        covered |= covers && highest > 0 && highest < MOST_HEIGHT * lowest;
        if (e == 0) first_side = side;
        covered &= side == first_side;  // both antennas look at one side of the facet
    }
    state[pair] = missed ? MISSED : covered ? COVERED : UNDECIDED;
}
