// The part of a facet that antennas see past other facets: its share of the area, and its phase integral, exactly.
//
//   share = area(L)/A,   mean_m = (1/A) integral over L of exp(+j q_m.rho) dA,   q_m = k_m (u_t + u_r)
//   L = facet less the shadows of all occluders;   integral over L = sum over its border of the signed triangles (0, a, b)
//
// The shadow of an occluder is a convex polygon: its part above the facet's plane, projected from the antenna onto that
// plane. The border of L consists of the pieces of the facet's edges and of the shadows' edges that no shadow covers. Whether
// an edge is covered is tested at the distance `slack` beside it, so that shadows that touch have no border between them, and of
// equal borders that of the larger shadow counts: neither order nor chains of corners are needed.
//
// source    docs/theory/shadows.md; phase integral of a triangle as a divided difference, as in sarcl/scattering/physical_optics.py:triangle_mean
// symbols   rho       from the facet's centroid, which is the origin of its axes x, y in the plane and z along its normal, m
//           slack     m, distance beside an edge; on_plane  m, distance below which a corner lies in the facet's plane
//           receiver  see receiver_axes.clh
//           shadow    (SHADOW,): least and largest x, least and largest y, up to five corners (x, y) anticlockwise, area
//           corners   of a shadow: 0 where it misses the facet, COVERS where it covers all of it
// macros    ENDS      antennas: 1 monostatic, 2 a transmitter and a receiver
//           WAVES     wavenumbers of a launch, 0 to 8
//           FORWARD   1: the second antenna looks at a facet from any side, and occluders whose pairs have the number
//                     ~occluder (of the facet's own body) cast no shadow from it
//           PARTS     covered parts of an edge that are listed at once: few on GPUs, so that they stay in registers
// numbers   float64 throughout: float32 cannot place points at `slack`, 1e-12 of a facet's edge, beside an edge
// reference: sarcl/reference/lit_part.py:lit_part

#include "receiver_axes.clh"

enum { SHADOW = 15, COVERS = 255, SLIVER = 300 };

typedef struct { double x, y; } point;

// (a x b) with the rounding errors of both products (Kahan): 0 to the bit for opposite vectors, whether a compiler fuses
// sums or not. Of shadows that reach a million times as far as the facet, rounding would part edges that two share.
static inline double crossed(double ax, double ay, double bx, double by) {
    double second = ay * bx;
    return fma(ax, by, -second) + fma(-ay, bx, second);
}

// Whether points all lie beyond one edge of an anticlockwise polygon; corners x, y.
static inline int apart(__global const double *polygon, int n, __global const double *others, int m, double slack) {
    for (int i = 0; i < n; i++) {
        int next = i + 1 == n ? 0 : i + 1, beyond = 1;
        double x = polygon[2 * i], y = polygon[2 * i + 1], ex = polygon[2 * next] - x, ey = polygon[2 * next + 1] - y;
        double margin = slack * sqrt(ex * ex + ey * ey);
        for (int j = 0; j < m; j++) beyond &= crossed(ex, ey, others[2 * j] - x, others[2 * j + 1] - y) <= margin;
        if (beyond) return 1;
    }
    return 0;
}

// Projection of a place from an antenna at `eye` onto the plane z = 0.
static inline place projected(place at, place eye) {
    double stretch = at.z / (eye.z - at.z);
    place out = {at.x + (at.x - eye.x) * stretch, at.y + (at.y - eye.y) * stretch, 0};
    return out;
}

static inline place between(place a, place b, double limit) {
    double part = (a.z - limit) / (a.z - b.z);
    place out = {a.x + part * (b.x - a.x), a.y + part * (b.y - a.y), limit};
    return out;
}

static inline void put_corner(__global double *out, int *n, place at, place eye) {
    place flat = projected(at, eye);
    out[4 + 2 * *n] = flat.x;
    out[5 + 2 * *n] = flat.y;
    (*n)++;
}

// Corners of the edge from a to b within the slab 0 <= z <= top, its end left out: the way around a triangle gives the
// corners of the part of it that lies in the slab, in their order.
static inline void put_edge(__global double *out, int *n, place a, place b, double top, place eye) {
    double first = a.z < b.z ? 0 : top, second = top - first;
    if (a.z >= 0 && a.z <= top) put_corner(out, n, a, eye);
    if ((a.z - first) * (b.z - first) < 0) put_corner(out, n, between(a, b, first), eye);
    if ((a.z - second) * (b.z - second) < 0) put_corner(out, n, between(a, b, second), eye);
}

typedef struct { int n_pairs; } cast_shadows_numbers;

// Shadows of occluders on receivers. global size (pairs; pulses ENDS)
//   receivers  (n, RECEIVER);  pair_receiver, pair_occluder (n_pairs);  occluders (., 9)   corners, m
//   antennas   (pulses, ENDS, 3)   m
//   shadows    (pulses, ENDS, n_pairs, SHADOW);  corners (pulses, ENDS, n_pairs)
__kernel void cast_shadows(cast_shadows_numbers given, __global const double *restrict receivers,
                           __global const int *restrict pair_receiver, __global const int *restrict pair_occluder,
                           __global const double *restrict occluders, __global const double *restrict antennas,
                           __global double *restrict shadows, __global uchar *restrict corners) {
    size_t pair = get_global_id(0), end = get_global_id(1), at = end * given.n_pairs + pair;
    __global const double *r = receivers + RECEIVER * (size_t)pair_receiver[pair];
    int number = pair_occluder[pair], is_own = FORWARD && number < 0, is_forward = FORWARD && (end & 1);
    __global const double *occluder = occluders + 9 * (size_t)(is_own ? ~number : number);
    corners[at] = 0;
    if (is_own && is_forward) return;
    __global const double *antenna = antennas + 3 * end;
    double dx = antenna[0] - r[0], dy = antenna[1] - r[1], dz = antenna[2] - r[2];
    double distance = sqrt(dx * dx + dy * dy + dz * dz), above = dx * r[9] + dy * r[10] + dz * r[11], both = above / distance;
#if ENDS == 2 && !FORWARD
    __global const double *other = antennas + 3 * (end ^ 1);
    double ox = other[0] - r[0], oy = other[1] - r[1], oz = other[2] - r[2];
    both += (ox * r[9] + oy * r[10] + oz * r[11]) / sqrt(ox * ox + oy * oy + oz * oz);
#endif
    // Edge-on, or behind the side that both antennas look at, an antenna casts no shadow: the echo fades instead
    // (sarcl/scattering/physical_optics.py:lit_share).
    double side = both < 0 ? -1 : 1, height = side * above;
    if (!(height > 1e-6 * distance)) return;
    place eye = {dx * r[3] + dy * r[4] + dz * r[5], dx * r[6] + dy * r[7] + dz * r[8], height};
    place a = in_axes(r, occluder[0], occluder[1], occluder[2], side);
    place b = in_axes(r, occluder[3], occluder[4], occluder[5], side);
    place c = in_axes(r, occluder[6], occluder[7], occluder[8], side);
    if (!(max(a.z, max(b.z, c.z)) > 0)) return;
    // anticlockwise, as the antenna sees it
    double bx = b.x - a.x, by = b.y - a.y, bz = b.z - a.z, cx = c.x - a.x, cy = c.y - a.y, cz = c.z - a.z;
    double faces = crossed(by, bz, cy, cz) * (eye.x - a.x) + crossed(bz, bx, cz, cx) * (eye.y - a.y) +
                   crossed(bx, by, cx, cy) * (eye.z - a.z);
    place second = faces < 0 ? c : b, third = faces < 0 ? b : c;
    double top = 0.999999 * height;  // what lies beyond the antenna casts no shadow
    __global double *out = shadows + SHADOW * at;
    int n = 0, covers = 1;
    put_edge(out, &n, a, second, top, eye);
    put_edge(out, &n, second, third, top, eye);
    put_edge(out, &n, third, a, top, eye);
    if (n < 3) return;
    double area = 0, around = 0, low_x = out[4], high_x = low_x, low_y = out[5], high_y = low_y;
    for (int i = 0; i < n; i++) {
        int next = i + 1 == n ? 0 : i + 1;
        double x = out[4 + 2 * i], y = out[5 + 2 * i], ex = out[4 + 2 * next] - x, ey = out[5 + 2 * next] - y;
        area += crossed(x - out[4], y - out[5], ex, ey);
        around += fabs(ex) + fabs(ey);
        for (int j = 0; j < 3; j++) covers &= crossed(ex, ey, r[12 + 2 * j] - x, r[13 + 2 * j] - y) >= 0;
        low_x = min(low_x, x);
        high_x = max(high_x, x);
        low_y = min(low_y, y);
        high_y = max(high_y, y);
    }
    // An occluder that is seen edge-on: near the tips of its shadow all edges are within `slack` of one another.
    if (!(area > SLIVER * r[19] * around)) return;
    if (apart(r + 12, 3, out + 4, n, r[19]) || apart(out + 4, n, r + 12, 3, r[19])) return;
    out[0] = low_x;
    out[1] = high_x;
    out[2] = low_y;
    out[3] = high_y;
    out[14] = area;
    corners[at] = covers ? COVERS : n;
}

// Part of the line a + beside + s d, 0 <= s <= 1, inside an anticlockwise polygon. `beside` is added last: far away, a holds
// no digits of it.
static inline int crosses(__global const double *corner, int n, point a, point beside, point d, double *from, double *to) {
    double low = 0, high = 1, x0 = corner[2 * n - 2], y0 = corner[2 * n - 1];
    for (int i = 0; i < n; i++) {
        double x1 = corner[2 * i], y1 = corner[2 * i + 1], ex = x1 - x0, ey = y1 - y0;
        double inside = crossed(ex, ey, a.x - x0, a.y - y0) + crossed(ex, ey, beside.x, beside.y), change = crossed(ex, ey, d.x, d.y);
        if (change > 0) low = max(low, -inside / change);
        else if (change < 0) high = min(high, -inside / change);
        else if (inside < 0) return 0;
        x0 = x1;
        y0 = y1;
    }
    *from = low;
    *to = high;
    return low < high;
}

// Take the part of an edge from `from` to `to`, covered by a shadow: s moves to its end where it holds s, and it is listed
// where it begins later. Where there is no room, the part that begins last is left out, and `known` falls to its begin.
static inline void put_part(double *begins, double *stops, int *n, double *known, double *s, double from, double to) {
    int at = *n;
    if (to <= *s || from >= *known) return;
    if (from <= *s) {
        *s = to;
        return;
    }
    if (at == PARTS) {
        double latest = begins[0];
        at = 0;
#pragma unroll
        for (int i = 1; i < PARTS; i++)
            if (begins[i] > latest) {
                latest = begins[i];
                at = i;
            }
        *known = min(*known, max(from, latest));
        if (from >= latest) return;
    } else
        *n = at + 1;
    if (PARTS < 8) {  // every index is constant
#pragma unroll
        for (int i = 0; i < PARTS; i++) {
            begins[i] = i == at ? from : begins[i];
            stops[i] = i == at ? to : stops[i];
        }
    } else {
        begins[at] = from;
        stops[at] = to;
    }
}

enum { CLOSE_INVERSE = 10000, SMALL_INVERSE = 100 };  // 1/rad: below these differences, and phases, series hold to 1e-10

// Integral of exp(j x t) over t from 0 to 1: exp(j x/2) sinc(x/2).
static inline point line_integral(double x) {
    double middle = 0.5 * x, sine = sin(middle), mean = fabs(middle) < 1e-3 ? 1.0 - middle * middle / 6.0 : sine / middle;
    point out = {cos(middle) * mean, sine * mean};
    return out;
}

// Integral of exp(j phase)/(2 area) over a triangle whose corners have the phases 0, b and c, rad: the divided difference of
// exp(j x) at these, (E(c) - E(b))/(j (c - b)), with E the integral over a line. For b near c it is the derivative of E/j at
// their mean m, (exp(j m) - E(m))/(j m), and for small phases a series in m.
static inline point triangle_integral(double b, double c) {
    double apart = c - b, m = 0.5 * (b + c);
    point out;
    if (fabs(apart) * CLOSE_INVERSE > 1) {
        point first = line_integral(b), second = line_integral(c);
        out.x = (second.y - first.y) / apart;
        out.y = (first.x - second.x) / apart;
    } else if (fabs(m) * SMALL_INVERSE > 1) {
        point line = line_integral(m);
        out.x = (sin(m) - line.y) / m;
        out.y = (line.x - cos(m)) / m;
    } else {
        out.x = 0.5 - m * m / 8.0;
        out.y = m / 3.0 - m * m * m / 30.0;
    }
    return out;
}

typedef struct { int n_pairs; } lit_parts_numbers;

// Lit parts of receivers. global size (receivers; pulses)
//   receivers, antennas, shadows, corners   as above
//   first    (receivers + 1)          first pair of each receiver
//   waves    (WAVES)                  k_m, rad/m
//   share    (pulses, receivers)      0 ... 1
//   mean     (pulses, receivers, WAVES, 2)   re, im
__kernel void lit_parts(lit_parts_numbers given, __global const double *restrict receivers, __global const int *restrict first,
                        __global const double *restrict antennas, __global const double *restrict shadows,
                        __global const uchar *restrict corners, __global const double *restrict waves,
                        __global float *restrict share, __global float *restrict mean) {
    size_t pulse = get_global_id(1), at = pulse * get_global_size(0) + get_global_id(0);
    __global const double *r = receivers + RECEIVER * get_global_id(0);
    int begin = first[get_global_id(0)], stop = first[get_global_id(0) + 1], dark = 0, shaded = 0;
    double qx = 0, qy = 0, area = 0, sums[2 * WAVES + 1];
    for (int e = 0; e < ENDS; e++) {
        __global const double *antenna = antennas + 3 * (pulse * ENDS + e);
        double dx = antenna[0] - r[0], dy = antenna[1] - r[1], dz = antenna[2] - r[2];
        double ways = (ENDS == 1 ? 2.0 : 1.0) / sqrt(dx * dx + dy * dy + dz * dz);
        qx += ways * (dx * r[3] + dy * r[4] + dz * r[5]);
        qy += ways * (dx * r[6] + dy * r[7] + dz * r[8]);
        for (int i = begin; i < stop; i++) {
            int n = corners[(pulse * ENDS + e) * given.n_pairs + i];
            shaded |= n;
            dark |= n == COVERS;
        }
    }
    if (!shaded) stop = begin;  // the facet's own edges are left
#pragma unroll
    for (int m = 0; m < 2 * WAVES; m++) sums[m] = 0;
    // edges of the facet, and then of each shadow
    for (int e = -1; e < ENDS && !dark; e++)
        for (int i = e < 0 ? stop - 1 : begin; i < stop; i++) {
            size_t own = (pulse * ENDS + (e < 0 ? 0 : e)) * given.n_pairs + i;
            int n = e < 0 ? 3 : corners[own];
            __global const double *polygon = e < 0 ? r + 12 : shadows + SHADOW * own + 4;
            double own_area = e < 0 ? 0.0 : shadows[SHADOW * own + 14];
            for (int side = 0; side < n; side++) {
                int next = side + 1 == n ? 0 : side + 1;
                point a = {polygon[2 * side], polygon[2 * side + 1]}, d = {polygon[2 * next] - a.x, polygon[2 * next + 1] - a.y};
                double length = sqrt(d.x * d.x + d.y * d.y), s = 0, end = 1;
                if (!(length > 0)) continue;
                point right = {d.y / length * r[19], -d.x / length * r[19]}, left = {-right.x, -right.y};
                point lit = e < 0 ? left : right;  // beside the edge, where the facet may be lit
                if (e >= 0 && !crosses(r + 12, 3, a, lit, d, &s, &end)) continue;
                double low_x = min(a.x, a.x + d.x) - r[19], high_x = max(a.x, a.x + d.x) + r[19];
                double low_y = min(a.y, a.y + d.y) - r[19], high_y = max(a.y, a.y + d.y) + r[19];
                while (s < end) {  // up to `known`, all parts of the edge that shadows cover are listed
                    double begins[PARTS], stops[PARTS], known = end;
                    int parts = 0;
                    for (int e_2 = 0; e_2 < ENDS; e_2++)
                        for (int k = begin; k < stop; k++) {
                            size_t other = (pulse * ENDS + e_2) * given.n_pairs + k;
                            if (corners[other] == 0 || (e >= 0 && other == own)) continue;
                            __global const double *shadow = shadows + SHADOW * other;
                            if (shadow[0] > high_x || shadow[1] < low_x || shadow[2] > high_y || shadow[3] < low_y) continue;
                            double from, to;
                            if (crosses(shadow + 4, corners[other], a, lit, d, &from, &to))
                                put_part(begins, stops, &parts, &known, &s, from, to);
                            if (e >= 0 && (shadow[14] > own_area || (shadow[14] == own_area && other < own)) &&
                                crosses(shadow + 4, corners[other], a, left, d, &from, &to))
                                put_part(begins, stops, &parts, &known, &s, from, to);
                        }
                    while (s < known) {  // from s on to the end of the shadows there, and then to the begin of the next one
                        double until = known;
                        int moved = 1;
                        while (moved && s < known) {
                            moved = 0;
                            until = known;
#if PARTS < 8  // every index is constant
#pragma unroll
#endif
                            for (int i = 0; i < (PARTS < 8 ? PARTS : parts); i++)
                                if (i < parts && begins[i] <= s && stops[i] > s) {
                                    s = stops[i];
                                    moved = 1;
                                } else if (i < parts && begins[i] > s)
                                    until = min(until, begins[i]);
                        }
                        if (s >= known) break;
                        double ax = a.x + s * d.x, ay = a.y + s * d.y, bx = a.x + until * d.x, by = a.y + until * d.y;
                        double twice = (e < 0 ? 1.0 : -1.0) * crossed(ax, ay, bx, by);
                        area += 0.5 * twice;
#pragma unroll
                        for (int m = 0; m < WAVES; m++) {
                            point part = triangle_integral(waves[m] * (qx * ax + qy * ay), waves[m] * (qx * bx + qy * by));
                            sums[2 * m] += twice * part.x;
                            sums[2 * m + 1] += twice * part.y;
                        }
                        s = until;
                    }
                }
            }
        }
    double part = area / r[18];
    int none = dark || !(part > 1e-9);
    share[at] = none ? 0.0f : (float)min(part, 1.0);
#pragma unroll
    for (int m = 0; m < 2 * WAVES; m++) mean[at * 2 * WAVES + m] = none ? 0.0f : (float)(sums[m] / r[18]);
}
