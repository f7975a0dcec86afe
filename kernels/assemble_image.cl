// Sums of tiles as rows of an image.
//
// macros    none
// reference: sarcl/imaging/tiling/plane.py:PlaneTiling.place

#undef VW
#define VW 1
#include "common.clh"

typedef struct {
    ulong pixels;
    int across, high, wide, columns;
} untile_numbers;

// global size (columns of the image, rows of these bands)
//   totals   (4, pixels)   of tiles `high` x `wide` one after another: re, im, and their rounding errors
//   slot     (bands, across): position of a tile among them
//   out      (rows, columns, 2)
__kernel void untile(untile_numbers given, __global const float *restrict totals, __global const int *restrict slot,
                     __global float *restrict out) {
    int column = get_global_id(0), row = get_global_id(1), high = given.high, wide = given.wide;
    size_t pixels = given.pixels;
    size_t tile = slot[(row / high) * given.across + column / wide];
    size_t i = tile * high * wide + (row % high) * wide + column % wide;
    size_t o = 2 * ((size_t)row * given.columns + column);
    out[o] = totals[i] + totals[i + 2 * pixels];
    out[o + 1] = totals[i + pixels] + totals[i + 3 * pixels];
}

// Copies the sums of tiles to where they stand among others. global size (pixels of a tile, tiles)
//   from     (4, n_from);  to (4, n_to);  slot (tiles)
__kernel void move(__global const float *restrict from, ulong n_from, __global const int *restrict slot,
                   __global float *restrict to, ulong n_to) {
    size_t per_tile = get_global_size(0), i = get_global_id(1) * per_tile + get_global_id(0);
    size_t o = (size_t)slot[get_global_id(1)] * per_tile + get_global_id(0);
    for (int plane = 0; plane < 4; plane++) to[plane * n_to + o] = from[plane * n_from + i];
}

// Adds the sums of parts of the pulses to those of an image, one part after another. global size (pixels)
//   parts    (n_parts, 4, pixels);  totals (4, pixels): re, im, and their rounding errors
__kernel void add_parts(__global const float *restrict parts, int n_parts, __global float *restrict totals) {
    size_t pixels = get_global_size(0), i = get_global_id(0);
    for (int p = 0; p < n_parts; p++, parts += 4 * pixels)
        for (int plane = 0; plane < 2; plane++) {
            __global float *total = totals + plane * pixels;
            add_compensated(total, total + 2 * pixels, i, parts[plane * pixels + i]);
            total[2 * pixels + i] += parts[(plane + 2) * pixels + i];
        }
}
