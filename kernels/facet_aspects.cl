// Amplitudes of planar facets, each seen from the place on a straight track that has one aspect, at one frequency.
//
//   a_k = k/(2 sqrt(pi)) S I g_t g_r (R/R_k)^2,   u_k = s along - c rho_k,   R_k = r_k/c
//
// source    sarcl/scattering/physical_optics.py; docs/theory/spectral_echo.md
// symbols   u_k      unit vector from a facet to the antenna;  s, c  sine and cosine of the aspect
//           along    unit vector of the track
//           rho_k    unit vector from the track to a facet's centroid at closest approach;  r_k  its distance, m
//           S, I     scattering and phase integral as in facet.clh;  g, R  weights of gains.clh
// macros    VW, FP64, RANGE, ORDER, GAINS, ALIKE, VARIES, CULL, SPREADING as in the headers; BISTATIC 0, NODES 1
//           HH, HV, VH, VV   1: wanted (first letter received)
//           ROUGH, DIAGRAM_*  see facet_planes.clh
// reference: sarcl/scattering/facets.py:FacetSet.amplitudes, sarcl/scattering/antenna_weights.py:AntennaWeights.weights

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "tile_paths.clh"
#include "vec3_complex.clh"
#include "pattern.clh"
#include "gains.clh"
#include "facet.clh"
#include "facet_planes.clh"

typedef struct {
    int n, second;
} aspect_amplitudes_numbers;

// global size (n/VW): work-item computes VW facets.
//   facets   (planes, n)  see facet_planes.clh;  across  (4, n)  rho_k, r_k
//   roots    (2, n)  1/sqrt(eps), re, im
//   aspect   (9)     along; s, c; f/c, cycles/m; k/(2 sqrt(pi)); f over the patterns' frequency; R of spreading
//   up       (6)     vertical, and the axis that replaces it for vectors along it;  patterns, second, axes (18)  see gains.clh
//   out      (polarisations, 2, n)   re, im
__kernel void aspect_amplitudes(aspect_amplitudes_numbers given, __global const float *restrict facets,
                                __global const float *restrict across, __global const float *restrict roots,
                                __global const float *restrict aspect, __global const float *restrict up,
                                __global const float *restrict patterns, __global const float *restrict axes,
                                __global float *restrict out) {
    size_t at = get_global_id(0);
    int n = given.n;
    float3 along = vload3(0, aspect), vertical = vload3(0, up), other = vload3(1, up);
    float s = aspect[3], c = aspect[4], wave = aspect[5];
    triple rho = load_triple(across, at, n);
    triple u = t_make(fma((fv)-c, rho.x, (fv)(s * along.x)), fma((fv)-c, rho.y, (fv)(s * along.y)),
                      fma((fv)-c, rho.z, (fv)(s * along.z)));
    triple edge_1 = load_triple(facets + F_EDGE * (size_t)n, at, n);
    triple edge_2 = load_triple(facets + (F_EDGE + 3) * (size_t)n, at, n);
    fv factor = LOAD(at, facets + F_FACTOR * (size_t)n);
    fv twice_area;
    triple normal = facing_normal(edge_1, edge_2, factor, u, &twice_area);
    fv cosine = t_dot(normal, u);
    triple h, v;
    polarisation(u, vertical, other, &h, &v);
    scattering S = scatter_back(normal, u, h, v, c_make(LOAD(at, roots), LOAD(at, roots + n)));
    fv twice = (fv)(2.0f * wave);
    complex_v mean = triangle_mean(twice * t_dot(u, edge_1), twice * t_dot(u, edge_2));
    mean = rough_mean(mean, (fv)1.0f, twice * cosine, cosine, (fv)0.5f * twice_area, wave, facets + F_ROUGH * (size_t)n, at, n);
    if (WEIGHTS) {
        fv away = LOAD(at, across + 3 * (size_t)n) / (fv)c;
        antenna_view view = antenna_view_of(u, away, u, away, axes, aspect[8]);
        mean = c_mul(mean, weight(view, patterns, given.second, aspect[7]));
    }
    fv scale = (cosine > 0 ? fabs(factor) : (fv)0.0f) * (fv)0.5f * twice_area * (fv)aspect[6];
    complex_v sent[4] = {S.hh, S.hv, S.vh, S.vv};
    int wanted[4] = {HH, HV, VH, VV}, channel = 0;
    for (int i = 0; i < 4; i++) {
        if (!wanted[i]) continue;
        complex_v a = c_mul(sent[i], mean);
        __global float *to = out + 2 * (size_t)channel * n;
        STORE(scale * a.re, at, to);
        STORE(scale * a.im, at, to + n);
        channel++;
    }
}
