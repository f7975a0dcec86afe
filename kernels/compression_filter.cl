// Spectra of Doppler bins times the filter of the secondary range compression, as rows for an FFT to range profiles.
//
//   P_q(n) = X_q(n) h_n A exp(+j 2 pi phi),   A = w(b/f) f/(f^2 - b^2)^(3/4)
//   phi = -(2 r/c) (g b/a)^2 / (sqrt(f^2 - b^2) + a + g fc/a),   g = f - fc,  a^2 = fc^2 - b^2
//
// Sample n lies at bin low - n (modulo length), low = n_samples/2, as in range_profiles.cl. The phase is many cycles, and
// computed in wide numbers.
//
// source    docs/theory/range_doppler.md; sarcl/imaging/range_doppler/_bins.py:_filter
// symbols   f, fc    frequency of sample n, and of the middle one, Hz;  b  of the bin, c q/(2 v), Hz
//           h        deconvolution of the interpolation kernel
//           w        weight of the Doppler band: 1, with tapers at both ends, times a window
// macros    FP64     of doubleword.clh
// reference: sarcl/reference/range_doppler.py:compressed

#undef VW
#define VW 1
#include "common.clh"
#include "doubleword.clh"

// Weight of a sine of the squint angle: 1 between low and high, falling to 0 over the tapers beyond; times a window that
// has values at first + i step, and is as at its ends beyond them.
static inline float band_weight(float sine, float low, float high, float taper, float first, float step, int n,
                                __global const float *restrict window) {
    float rise = clamp(fmin((sine - low) / taper, (high - sine) / taper) + 1, 0.0f, 1.0f);
    float at = clamp((sine - first) / step, 0.0f, (float)(n - 1)), below = floor(at);
    int i = (int)below, next = min(i + 1, n - 1);
    float value = fma(at - below, window[next] - window[i], window[i]);
    return value * (rise * rise * rise * fma(rise, fma(rise, 6.0f, -15.0f), 10.0f));
}

typedef struct {
    float center[2], delay[2], low, high, taper, window_first, window_step;
    int n_samples, first, period, n_bins, begin, n_window;
} compress_numbers;

// global size (length, bins)
//   spectra      (rows, n_samples, 2): bin q is row (first + q) modulo `period`
//   frequencies  (2, n_samples): f, a value and its rest;  factors (n_samples): h
//   bends        (3, n_bins): b, a value and its rest, and 1, or 0 for bins that are left out; from `begin` on
//   window       (n_window): its values from the sine window_first on, window_step apart
//   center, delay  fc and twice r/c, each a value and its rest
//   out          (bins, length, 2)
__kernel void compress(compress_numbers given, __global const float *restrict spectra,
                       __global const float *restrict frequencies, __global const float *restrict factors,
                       __global const float *restrict bends, __global const float *restrict window,
                       __global float *restrict out) {
    int bin = get_global_id(0), length = get_global_size(0), q = given.begin + (int)get_global_id(1);
    int n_samples = given.n_samples, n_bins = given.n_bins, middle = n_samples / 2;
    int n = bin <= middle ? middle - bin : middle + length - bin, whole;
    float2 made = (float2)(0, 0);
    if (n < n_samples && bends[2 * n_bins + q] > 0) {
        wv f = w_load(frequencies, n, n_samples), b = w_load(bends, q, n_bins), fc = w_make(given.center[0], given.center[1]);
        wv g = w_sub(f, fc);
        wv root = w_sqrt(w_mul(w_sub(f, b), w_add(f, b))), a = w_sqrt(w_mul(w_sub(fc, b), w_add(fc, b)));
        wv turn = w_mul(g, w_div(b, a)), under = w_add(w_add(root, a), w_mul(g, w_div(fc, a)));
        wv cycles = w_mul(w_make(given.delay[0], given.delay[1]), w_div(w_mul(turn, turn), under));
        float s, c, level = w_float(root), sine = w_float(b) / w_float(f);
        sincos_cycles(w_split(cycles, &whole), &s, &c);
        level = w_float(f) / (level * sqrt(level)) * factors[n];
        level *= band_weight(sine, given.low, given.high, given.taper, given.window_first, given.window_step, given.n_window,
                             window);
        float2 x = vload2((size_t)((given.first + q) % given.period) * n_samples + n, spectra);
        made = level * (float2)(fma(x.s0, c, x.s1 * s), fma(x.s1, c, -x.s0 * s));  // the phase is less than 0
    }
    vstore2(made, get_global_id(1) * (size_t)length + bin, out);
}
