// The part of a facet that antennas see past other facets: its share of the area, and its phase integral, exactly.
//
//   share = area(L)/A,   mean_m = (1/A) integral over L of exp(+j q_m.rho) dA,   q_m = k_m (u_t + u_r)
//   L = facet less the shadows of all occluders;   integral over L = sum over its border of the signed triangles (0, a, b)
//
// The shadow of an occluder is a convex polygon: its part above the facet's plane, projected from the antenna onto that
// plane. The border of L consists of the pieces of the facet's edges and of the shadows' edges that no shadow covers. Which
// side of an edge is covered is looked at `slack` beside it, so that shadows that touch have no border between them, and of
// equal borders that of the larger shadow counts: neither order nor chains of corners are needed.
//
// source    docs/theory/shadows.md; phase integral of a triangle: sarcl/scattering/physical_optics.py:triangle_mean
// symbols   rho       from the facet's centroid, which is the origin of its axes x, y in the plane and z along its normal, m
//           slack     m, distance beside an edge; on_plane  m, distance below which a corner lies in the facet's plane
//           receiver  (RECEIVER,): origin, x, y, z, three corners (x, y) anticlockwise, area, slack, on_plane
//           shadow    (SHADOW,): least and largest x, least and largest y, up to five corners (x, y) anticlockwise, area
//           corners   of a shadow: 0 where it misses the facet, COVERS where it covers all of it
// macros    ENDS      antennas: 1 monostatic, 2 a transmitter and a receiver
//           (all in float64: edges of shadows that coincide are told apart by 1e-12 of a facet)
// reference: sarcl/reference/lit_part.py:lit_part

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

enum { RECEIVER = 21, SHADOW = 15, COVERS = 255, MOST_WAVES = 16, SLIVER = 300 };

typedef struct { double x, y; } point;

static inline double crossed(double ax, double ay, double bx, double by) { return ax * by - ay * bx; }

// Corners of a polygon on the inner side of a plane z = limit: below it where `below`, else above it.
static inline int cut_polygon(const double *in, int n, double limit, int below, double *out) {
    int made = 0;
    for (int i = 0; i < n; i++) {
        const double *a = in + 3 * i, *b = in + 3 * (i + 1 == n ? 0 : i + 1);
        double from = below ? limit - a[2] : a[2] - limit, to = below ? limit - b[2] : b[2] - limit;
        if (from >= 0) {
            for (int j = 0; j < 3; j++) out[3 * made + j] = a[j];
            made++;
        }
        if ((from > 0 && to < 0) || (from < 0 && to > 0)) {
            double part = from / (from - to);
            for (int j = 0; j < 2; j++) out[3 * made + j] = a[j] + part * (b[j] - a[j]);
            out[3 * made + 2] = limit;
            made++;
        }
    }
    return made;
}

// Whether points all lie beyond one edge of an anticlockwise polygon.
static inline int apart(const point *polygon, int n, const point *others, int m, double slack) {
    for (int i = 0; i < n; i++) {
        point a = polygon[i], b = polygon[i + 1 == n ? 0 : i + 1];
        double ex = b.x - a.x, ey = b.y - a.y, margin = slack * sqrt(ex * ex + ey * ey);
        int beyond = 1;
        for (int j = 0; j < m; j++) beyond &= crossed(ex, ey, others[j].x - a.x, others[j].y - a.y) <= margin;
        if (beyond) return 1;
    }
    return 0;
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
    __global const double *occluder = occluders + 9 * (size_t)pair_occluder[pair];
    corners[at] = 0;
    double eye[3], away = 0, solid[3 * 3], above[3 * 4], kept[3 * 5], highest = 0;
    for (int i = 0; i < 3; i++) {
        double part = antennas[3 * end + i] - r[i];
        away += part * part;
    }
    for (int j = 0; j < 3; j++) {
        eye[j] = 0;
        for (int i = 0; i < 3; i++) eye[j] += (antennas[3 * end + i] - r[i]) * r[3 + 3 * j + i];
    }
    double side = eye[2] < 0 ? -1.0 : 1.0, height = side * eye[2];
    if (!(height > 1e-6 * sqrt(away))) return;  // the facet is seen edge-on
    for (int v = 0; v < 3; v++) {
        for (int j = 0; j < 3; j++) {
            double sum = 0;
            for (int i = 0; i < 3; i++) sum += (occluder[3 * v + i] - r[i]) * r[3 + 3 * j + i];
            solid[3 * v + j] = sum;
        }
        double z = side * solid[3 * v + 2];
        solid[3 * v + 2] = fabs(z) <= r[20] ? 0.0 : z;
        highest = max(highest, solid[3 * v + 2]);
    }
    if (!(highest > 0)) return;
    int n = cut_polygon(solid, 3, 0.0, 0, above);
    const double *from = above;
    double top = 0.999999 * height;
    if (highest > top) {  // what lies beyond the antenna casts no shadow
        n = cut_polygon(above, n, top, 1, kept);
        from = kept;
    }
    if (n < 3) return;
    point polygon[5], facet[3];
    double area = 0, around = 0;
    for (int i = 0; i < n; i++) {
        double stretch = from[3 * i + 2] / (height - from[3 * i + 2]);
        polygon[i].x = from[3 * i] + (from[3 * i] - eye[0]) * stretch;
        polygon[i].y = from[3 * i + 1] + (from[3 * i + 1] - eye[1]) * stretch;
    }
    for (int i = 0; i < n; i++) {
        point a = polygon[i], b = polygon[i + 1 == n ? 0 : i + 1];
        area += crossed(a.x, a.y, b.x, b.y);
        around += fabs(b.x - a.x) + fabs(b.y - a.y);
    }
    // An occluder that is seen edge-on: near the tips of its shadow all edges are within `slack` of one another.
    if (!(fabs(area) > SLIVER * r[19] * around)) return;
    if (area < 0)
        for (int i = 0; i < n / 2; i++) {
            point swap = polygon[i];
            polygon[i] = polygon[n - 1 - i];
            polygon[n - 1 - i] = swap;
        }
    for (int i = 0; i < 3; i++) {
        facet[i].x = r[12 + 2 * i];
        facet[i].y = r[13 + 2 * i];
    }
    if (apart(facet, 3, polygon, n, r[19]) || apart(polygon, n, facet, 3, r[19])) return;
    int covers = 1;
    __global double *out = shadows + SHADOW * at;
    double low_x = polygon[0].x, high_x = low_x, low_y = polygon[0].y, high_y = low_y;
    for (int i = 0; i < n; i++) {
        point a = polygon[i], b = polygon[i + 1 == n ? 0 : i + 1];
        for (int j = 0; j < 3; j++) covers &= crossed(b.x - a.x, b.y - a.y, facet[j].x - a.x, facet[j].y - a.y) >= 0;
        low_x = min(low_x, a.x);
        high_x = max(high_x, a.x);
        low_y = min(low_y, a.y);
        high_y = max(high_y, a.y);
        out[4 + 2 * i] = a.x;
        out[5 + 2 * i] = a.y;
    }
    out[0] = low_x;
    out[1] = high_x;
    out[2] = low_y;
    out[3] = high_y;
    out[14] = fabs(area);
    corners[at] = covers ? COVERS : n;
}

// Part of the line a + s d, 0 <= s <= 1, inside an anticlockwise polygon.
static inline int crosses(__global const double *corner, int n, point a, point d, double *from, double *to) {
    double low = 0, high = 1, x0 = corner[2 * n - 2], y0 = corner[2 * n - 1];
    for (int i = 0; i < n; i++) {
        double x1 = corner[2 * i], y1 = corner[2 * i + 1], ex = x1 - x0, ey = y1 - y0;
        double inside = crossed(ex, ey, a.x - x0, a.y - y0), change = crossed(ex, ey, d.x, d.y);
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

static inline double sinc(double x) { return fabs(x) < 1e-3 ? 1.0 - x * x / 6.0 : sin(x) / x; }

// Integral of exp(j phase)/(2 area) over a triangle whose corners have the phases 0, b and c, rad.
static inline void triangle_integral(double b, double c, double *re, double *im) {
    double zero = 0, low = min(b, c), high = max(b, c), x = min(low, zero), z = max(high, zero), y = max(low, min(high, zero));
    double u = 0.5 * (z - y), v = 0.5 * (y - x), w = u + v, su = sinc(u), sv = sinc(v), quotient;
    if (w < 0.5) {  // (sinc u - sinc v)/(u + v) in powers of u and v: no digits are lost
        double uu = u * u, vv = v * v, series = 0, h = 0, power = 1, factorial = 1, sign = 1;
        for (int m = 1; m < 8; m++) {
            h = power + uu * h;
            power *= vv;
            factorial *= 2 * m * (2 * m + 1);
            sign = -sign;
            series += sign / factorial * h;
        }
        quotient = (u - v) * series;
    } else
        quotient = (su - sv) / w;
    double real = 0.5 * sinc(0.5 * w) * (su + sv), imaginary = -cos(0.5 * w) * quotient;
    double turn = (v - u) / 6.0 + (b + c) / 3.0, s = sin(turn), t = cos(turn);
    *re = 0.5 * (real * t - imaginary * s);
    *im = 0.5 * (real * s + imaginary * t);
}

typedef struct { int n_pairs, n_waves; } lit_parts_numbers;

// Lit parts of receivers. global size (receivers; pulses)
//   receivers, antennas, shadows, corners   as above
//   first    (receivers + 1)          first pair of each receiver
//   waves    (n_waves <= MOST_WAVES)  k_m, rad/m
//   share    (pulses, receivers)      0 ... 1
//   mean     (pulses, receivers, n_waves, 2)   re, im
__kernel void lit_parts(lit_parts_numbers given, __global const double *restrict receivers, __global const int *restrict first,
                        __global const double *restrict antennas, __global const double *restrict shadows,
                        __global const uchar *restrict corners, __global const double *restrict waves,
                        __global float *restrict share, __global float *restrict mean) {
    size_t pulse = get_global_id(1), at = pulse * get_global_size(0) + get_global_id(0);
    __global const double *r = receivers + RECEIVER * get_global_id(0);
    int begin = first[get_global_id(0)], stop = first[get_global_id(0) + 1], dark = 0;
    double qx = 0, qy = 0, area = 0, sums[2 * MOST_WAVES];
    for (int e = 0; e < ENDS; e++) {
        double d[3], length = 0, px = 0, py = 0;
        for (int i = 0; i < 3; i++) {
            d[i] = antennas[3 * (pulse * ENDS + e) + i] - r[i];
            length += d[i] * d[i];
            px += d[i] * r[3 + i];
            py += d[i] * r[6 + i];
        }
        length = sqrt(length);
        qx += px / length * (ENDS == 1 ? 2.0 : 1.0);
        qy += py / length * (ENDS == 1 ? 2.0 : 1.0);
        for (int i = begin; i < stop; i++) dark |= corners[(pulse * ENDS + e) * given.n_pairs + i] == COVERS;
    }
    for (int m = 0; m < 2 * given.n_waves; m++) sums[m] = 0;
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
                double off_x = d.y / length * r[19], off_y = -d.x / length * r[19];
                point right = {a.x + off_x, a.y + off_y}, left = {a.x - off_x, a.y - off_y};
                point lit = e < 0 ? left : right;  // beside the edge, where the facet may be lit
                if (e >= 0 && !crosses(r + 12, 3, lit, d, &s, &end)) continue;
                double low_x = min(a.x, a.x + d.x) - r[19], high_x = max(a.x, a.x + d.x) + r[19];
                double low_y = min(a.y, a.y + d.y) - r[19], high_y = max(a.y, a.y + d.y) + r[19];
                while (s < end) {  // from s on to the end of the shadows there, and then to the begin of the next one
                    double until = end;
                    int moved = 1;
                    while (moved && s < end) {
                        moved = 0;
                        until = end;
                        for (int e_2 = 0; e_2 < ENDS; e_2++)
                            for (int k = begin; k < stop; k++) {
                                size_t other = (pulse * ENDS + e_2) * given.n_pairs + k;
                                if (corners[other] == 0 || (e >= 0 && other == own)) continue;
                                __global const double *shadow = shadows + SHADOW * other;
                                if (shadow[0] > high_x || shadow[1] < low_x || shadow[2] > high_y || shadow[3] < low_y) continue;
                                double from, to;
                                int covered = crosses(shadow + 4, corners[other], lit, d, &from, &to);
                                if (covered && from <= s && to > s) {
                                    s = to;
                                    moved = 1;
                                } else if (covered && from > s)
                                    until = min(until, from);
                                if (e >= 0 && (shadow[14] > own_area || (shadow[14] == own_area && other < own)) &&
                                    crosses(shadow + 4, corners[other], left, d, &from, &to)) {
                                    if (from <= s && to > s) {
                                        s = to;
                                        moved = 1;
                                    } else if (from > s)
                                        until = min(until, from);
                                }
                            }
                    }
                    if (s >= end) break;
                    double ax = a.x + s * d.x, ay = a.y + s * d.y, bx = a.x + until * d.x, by = a.y + until * d.y;
                    double twice = (e < 0 ? 1.0 : -1.0) * crossed(ax, ay, bx, by);
                    area += 0.5 * twice;
                    for (int m = 0; m < given.n_waves; m++) {
                        double re, im;
                        triangle_integral(waves[m] * (qx * ax + qy * ay), waves[m] * (qx * bx + qy * by), &re, &im);
                        sums[2 * m] += twice * re;
                        sums[2 * m + 1] += twice * im;
                    }
                    s = until;
                }
            }
        }
    double part = area / r[18];
    int none = dark || !(part > 1e-9);
    share[at] = none ? 0.0f : (float)min(part, 1.0);
    for (int m = 0; m < 2 * given.n_waves; m++) mean[at * 2 * given.n_waves + m] = none ? 0.0f : (float)(sums[m] / r[18]);
}
