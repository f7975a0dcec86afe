// Which facets a viewpoint sees: one ray a facet, through its centroid.
//
//   hidden_i = 1 where some other facet covers (xi_i, eta_i) and zeta there < zeta_i - bias_i
//
// source    perspective projection about the viewpoint keeps triangles triangles, and inverse depth linear on them
// symbols   xi, eta   place across the line of sight, m; zeta  R0 - R0^2/depth, m: grows with depth, linear on a facet
//           facet     (n, 9): xi, eta, zeta of corner 0; A1, B1, A2, B2 of the barycentric coordinates
//                     b1 = A1 dxi + B1 deta, b2 = A2 dxi + B2 deta; zeta's gradient in xi and eta
//           cell      square of the (xi, eta) plane; `start` (cells + 1,) indexes `member`, the facets that touch it;
//                     facets are numbered cell by cell, so that neighbouring rays read neighbouring facets
// macros    none
// reference: sarcl/reference/shadow.py:hidden

__kernel void hidden(__global const float *restrict ray, __global const int *restrict ray_cell,
                     __global const float *restrict facet, __global const int *restrict start,
                     __global const int *restrict member, int n, __global int *restrict out) {
    int i = get_global_id(0);
    float xi = ray[i], eta = ray[n + i], zeta = ray[2 * n + i] - ray[3 * n + i];
    int found = 0, stop = start[ray_cell[i] + 1];
    for (int m = start[ray_cell[i]]; m < stop && !found; m++) {
        __global const float *f = facet + 9 * (size_t)member[m];
        float dxi = xi - f[0], deta = eta - f[1];
        float b1 = f[3] * dxi + f[4] * deta, b2 = f[5] * dxi + f[6] * deta;
        float there = f[2] + f[7] * dxi + f[8] * deta;
        found = member[m] != i && b1 >= 0 && b2 >= 0 && b1 + b2 <= 1 && there < zeta;
    }
    out[i] = found;
}
