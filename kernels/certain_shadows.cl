// Which shadows certainly miss a facet, or cover all of it, whatever antenna of several casts them.
//
//   w(e, x) = ((b - a) x (e - a)).(x - a),   0 where x lies in the plane through an antenna e and an edge from a to b
//
// w is linear in e and linear in x. Where it has one sign at the corners of a box of antennas and at the corners of a facet,
// it has that sign for all antennas in the box and all points of the facet.
//   missed    all of one lies beyond some edge of the other, or within `slack` of it
//   covered   the facet lies on the inner side of all edges of the occluder, and behind it
//
// source    docs/theory/shadows.md; as separating axes of convex polygons (Gottschalk, Lin and Manocha 1996), in perspective
// symbols   receiver, slack, on_plane   see receiver_axes.clh;  eye  a corner of a box of antennas, m
// macros    ENDS   boxes: 1 of a monostatic antenna, 2 of a transmitter and of a receiver
// numbers   float64, as in lit_parts.cl
// reference: sarcl/reference/certain_shadows.py:certain_shadow

#include "receiver_axes.clh"

enum { UNDECIDED = 0, MISSED = 1, COVERED = 2, MOST_EYES = 8 };
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

// 1 where all are positive, -1 where all are negative, else 0.
static inline int common_sign(const double *values, int n) {
    int positive = 1, negative = 1;
    for (int i = 0; i < n; i++) {
        positive &= values[i] > 0;
        negative &= values[i] < 0;
    }
    return positive - negative;
}

// Bits: 1 where three places all lie beyond an edge of a triangle that antennas see anticlockwise (sign 1) or clockwise
// (-1), 2 where all lie on its inner side.
static inline int sides(const place *triangle, int edge, const place *eye, int n_eyes, int sign, const place *others,
                        double margin) {
    place a = triangle[edge], along = minus(triangle[edge == 2 ? 0 : edge + 1], a);
    int beyond = 1, inner = 2;
    for (int k = 0; k < n_eyes && (beyond || inner); k++) {
        place normal = cross3(along, minus(eye[k], a));
        double most = margin * sqrt(dot3(normal, normal));
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
//   eyes       (ENDS, n_eyes, 3)   m, up to MOST_EYES of each
//   state      (pairs)   UNDECIDED, MISSED from all antennas, or COVERED from those of one box
__kernel void certain_shadows(certain_shadows_numbers given, __global const double *restrict receivers,
                              __global const int *restrict pair_receiver, __global const int *restrict pair_occluder,
                              __global const double *restrict occluders, __global const double *restrict eyes,
                              __global uchar *restrict state) {
    size_t pair = get_global_id(0);
    __global const double *r = receivers + RECEIVER * (size_t)pair_receiver[pair];
    __global const double *o = occluders + 9 * (size_t)pair_occluder[pair];
    int n = given.n_eyes, missed = 1, covered = 0, side[ENDS];
    double margin = IN_PLANE * r[19];
    place facet[3], solid[3];
    for (int i = 0; i < 3; i++) {
        place corner = {r[12 + 2 * i], r[13 + 2 * i], 0};
        facet[i] = corner;
        solid[i] = in_axes(r, o[3 * i], o[3 * i + 1], o[3 * i + 2], 1);
    }
    place normal = cross3(minus(solid[1], solid[0]), minus(solid[2], solid[0]));
    for (int e = 0; e < ENDS; e++) {
        place eye[MOST_EYES];
        double height[MOST_EYES], before[MOST_EYES], lowest = INFINITY;
        int above = 1;
        for (int k = 0; k < n; k++) {
            __global const double *at = eyes + 3 * (e * n + k);
            double x = at[0] - r[0], y = at[1] - r[1], z = at[2] - r[2];
            place here = {x * r[3] + y * r[4] + z * r[5], x * r[6] + y * r[7] + z * r[8], x * r[9] + y * r[10] + z * r[11]};
            eye[k] = here;
            height[k] = here.z;
            before[k] = dot3(normal, minus(here, solid[0]));
            lowest = min(lowest, fabs(here.z));
            above &= fabs(here.z) > LEAST_HEIGHT * sqrt(dot3(here, here));
        }
        side[e] = common_sign(height, n);
        int facing = common_sign(before, n), apart = 0, inner = 2;
        for (int i = 0; i < 3 && facing && (inner || !apart); i++) {
            int found = sides(solid, i, eye, n, facing, facet, margin);
            apart |= found & 1;
            inner &= found;
        }
        for (int i = 0; i < 3 && side[e] && !apart; i++) apart = sides(facet, i, eye, n, side[e], solid, margin) & 1;
        missed &= apart;
        int behind = facing && side[e] && above && inner;
        for (int i = 0; i < 3; i++) {
            double high = side[e] * solid[i].z;
            behind &= high > 0 && high < MOST_HEIGHT * lowest && facing * dot3(normal, minus(facet[i], solid[0])) <= 0;
        }
        covered |= behind;
    }
    for (int e = 1; e < ENDS; e++) covered &= side[e] == side[0];  // both look at one side of the facet
    state[pair] = missed ? MISSED : covered ? COVERED : UNDECIDED;
}
