// Currents of a target's cells, added up with the phases of their paths from the transmitter and to the receiver, for
// many pulses: waveform forming.
//
//   s[f, p] = sum over cells n of I_f[n] exp(-2 pi j (kappa_f (D_t - d.y_n) + rho_f,p D_r))
//   D = |a - y| - |a| = -2 m/(1 + sqrt(1 - 2 m/R)),   m = u.y - |y|^2/(2 R),   antenna at a = R u, all from the centre
//
// source    B. Zou, Y. Jia and Z. Qiao, Proc. SPIE 11742 (2021), equations (4) to (6); docs/theory/waveform_forming.md
// symbols   cell      (cells, 4): y, m, and |y|^2/2, m^2;   current (n_frequencies, cells, 2): I
//           chunk     (chunks + 1,) int: first cell of each
//           antenna   (4, or 8 with a receiver of its own; n): u and 1/R of each pulse
//           kappa     (n_frequencies,): wavenumber sent, cycles per m, and rho (n_frequencies, n): wavenumber received
//           travel    d: direction of travel of the wave that made the currents
//           sums      (chunks, frequencies up to whole blocks, 2, n): cosine and sine part of s
// macros    VW        pulses per work-item; n is a multiple of it
//           BISTATIC  1: receiver and rho apart; 0: receiver = transmitter and rho = kappa
//           GROUP     work-items of a group along the pulses, which keep paths in local memory: on GPUs private arrays that
//                     are indexed by variables lie in global memory; 0: groups of any size, paths in private memory
//           LINEAR    1: the phase is linear in the frequency over BLOCK frequencies, and followed by complex products
// reference: sarcl/reference/equations.py:current_sums

#include "common.clh"

#define BLOCK 8   // frequencies whose sums are in registers
#define TILE 32   // cells whose paths are kept for all blocks of frequencies

// Paths of a work-item for the cells of a tile; no other item reads them.
#if GROUP
#define PATHS __local fv
#define PATH(i) ((i) * GROUP + (int)get_local_id(0))
#define N_PATHS (TILE * GROUP)
#else
#define PATHS fv
#define PATH(i) (i)
#define N_PATHS TILE
#endif
#define N_BACK (BISTATIC ? N_PATHS : 1)

// D of a cell
static inline fv longer(fv x, fv y, fv z, fv inverse, float4 cell) {
    fv m = fma(x, (fv)cell.x, fma(y, (fv)cell.y, fma(z, (fv)cell.z, (fv)(-cell.w) * inverse)));
    return (fv)(-2.0f) * m / ((fv)1.0f + sqrt(fmax(fma((fv)(-2.0f) * m, inverse, (fv)1.0f), (fv)0.0f)));
}

// Cycles by which the wave of a cell is late: its path in all, or on the way out and `back`, kappa and rho cycles/m.
static inline fv late(float kappa, fv path, fv rho, fv back) {
    return BISTATIC ? fma((fv)kappa, path, rho * back) : (fv)kappa * path;
}

static inline void wave(fv cycles, fv *re, fv *im) {
    fv s;
    sincos_cycles(cycles - nearest(cycles), &s, re);
    *im = -s;
}

typedef struct {
    int cells, n_frequencies, n;
    float travel[3];
} current_sums_numbers;

// global size (n / VW, in groups of GROUP; chunks; 1 or more: work-items among which blocks of frequencies are divided)
__kernel void current_sums(current_sums_numbers given, __global const float4 *restrict cell,
                           __global const float2 *restrict current, __global const int *restrict chunk,
                           __global const float *restrict antenna, __global const float *restrict kappa,
                           __global const float *restrict rho, __global float *restrict sums) {
    int p = get_global_id(0), here = get_global_id(1), n = given.n, n_frequencies = given.n_frequencies;
    float travel_x = given.travel[0], travel_y = given.travel[1], travel_z = given.travel[2];
    int blocks = (n_frequencies + BLOCK - 1) / BLOCK;
    fv ux = LOAD(p, antenna), uy = LOAD(p, antenna + n), uz = LOAD(p, antenna + 2 * n), near = LOAD(p, antenna + 3 * n);
    fv vx, vy, vz, v_near;
    if (BISTATIC) {
        vx = LOAD(p, antenna + 4 * n), vy = LOAD(p, antenna + 5 * n), vz = LOAD(p, antenna + 6 * n);
        v_near = LOAD(p, antenna + 7 * n);
    }
    PATHS path[N_PATHS];
    PATHS back[N_BACK];
    int first = chunk[here], end = chunk[here + 1];
    for (int start = first; start < end; start += TILE) {
        int many = min(TILE, end - start);
        for (int i = 0; i < many; i++) {
            float4 y = cell[start + i];
            fv sent = longer(ux, uy, uz, near, y);
            float along = fma(travel_x, y.x, fma(travel_y, y.y, travel_z * y.z));
            path[PATH(i)] = BISTATIC ? sent - along : fma(sent, (fv)2.0f, (fv)(-along));
            if (BISTATIC) back[PATH(i)] = longer(vx, vy, vz, v_near, y);
        }
        for (int b = get_global_id(2); b < blocks; b += get_global_size(2)) {
            __global float *sum = sums + 2 * (size_t)n * (here * blocks + b) * BLOCK;
            int f0 = b * BLOCK, last = n_frequencies - 1;
            fv re[BLOCK], im[BLOCK];
            for (int j = 0; j < BLOCK; j++) {
                re[j] = start == first ? (fv)0.0f : LOAD(p, sum + 2 * n * j);
                im[j] = start == first ? (fv)0.0f : LOAD(p, sum + 2 * n * j + n);
            }
            // LINEAR: frequencies are evenly spaced, and waves turn from each to the next
            int f1 = min(f0 + 1, last);
            float k0 = kappa[f0], dk = kappa[f1] - k0;
            fv r0 = 0, dr = 0;
            if (LINEAR && BISTATIC) {
                r0 = LOAD(p, rho + (size_t)f0 * n);
                dr = LOAD(p, rho + (size_t)f1 * n) - r0;
            }
            for (int i = 0; i < many; i++) {
                __global const float2 *at = current + start + i;
                fv c, s, turn_c, turn_s, path_out = path[PATH(i)], path_back = 0;
                if (BISTATIC) path_back = back[PATH(i)];
                if (LINEAR) {
                    wave(late(k0, path_out, r0, path_back), &c, &s);
                    wave(late(dk, path_out, dr, path_back), &turn_c, &turn_s);
                }
#pragma unroll
                for (int j = 0; j < BLOCK; j++) {
                    int f = min(f0 + j, last);
                    float2 value = at[(size_t)f * given.cells];
                    fv kappa_back = BISTATIC ? LOAD(p, rho + (size_t)f * n) : (fv)0.0f;
                    if (!LINEAR) wave(late(kappa[f], path_out, kappa_back, path_back), &c, &s);
                    re[j] = fma((fv)value.x, c, fma((fv)(-value.y), s, re[j]));
                    im[j] = fma((fv)value.x, s, fma((fv)value.y, c, im[j]));
                    if (LINEAR) {
                        fv turned = fma(c, turn_c, -s * turn_s);
                        s = fma(c, turn_s, s * turn_c);
                        c = turned;
                    }
                }
            }
            for (int j = 0; j < BLOCK; j++) {
                STORE(re[j], p, sum + 2 * n * j);
                STORE(im[j], p, sum + 2 * n * j + n);
            }
        }
    }
}
