/* Arithmetic on LANES simulations at once: V holds one double a lane, M one mask a lane.
   Everything is written out from + - * / and comparisons, without libm and without contraction,
   so that any compiler, any lane width and any IEEE 754 host give the same bits. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifndef LANES
#define LANES 1
#endif

#define AT_LEAST_1(n) ((n) > 0 ? (n) : 1)

/* Functions that a run calls once: compiled quickly, not for speed. The numbers are the same. */
#if defined(__clang__)
#define ONCE __attribute__((optnone, noinline))
#elif defined(__GNUC__)
#define ONCE __attribute__((optimize("O0")))
#else
#define ONCE
#endif

/* V: one double a lane. M: one truth a lane. B: the 64 bits of a V as integers. */
#if LANES == 1
typedef double V;
typedef int64_t B;
#define K(x) (x)
#define KB(x) ((int64_t)(x))
#define LANE(v, i) (v)
static inline B bits(V x) { B b; memcpy(&b, &x, sizeof b); return b; }
static inline V from_bits(B b) { V x; memcpy(&x, &b, sizeof x); return x; }
#else
typedef double V __attribute__((vector_size(8 * LANES)));
typedef int64_t B __attribute__((vector_size(8 * LANES)));
#if LANES == 2
#define SPREAD(x) x, x
#elif LANES == 4
#define SPREAD(x) x, x, x, x
#elif LANES == 8
#define SPREAD(x) x, x, x, x, x, x, x, x
#else
#error "LANES is 1, 2, 4 or 8"
#endif
#define K(x) ((V){SPREAD(x)})
#define KB(x) ((B){SPREAD(x)})
#define LANE(v, i) ((v)[i])
static inline B bits(V x) { return (B)x; }
static inline V from_bits(B b) { return (V)b; }
#endif
#define FOR_LANES(i) for (int i = 0; i < LANES; ++i)

/* Comparison and selection: the machine's own masks where it has them, else plain bits. least(a, b) is
   a < b ? a : b and most(a, b) is a > b ? a : b in all four, so that a NaN gives b. */
#if LANES == 1
typedef int M;
static inline M less(V a, V b) { return a < b; }
static inline M less_equal(V a, V b) { return a <= b; }
static inline M equal(V a, V b) { return a == b; }
static inline M both(M a, M b) { return a & b; }
static inline M either(M a, M b) { return a | b; }
static inline M opposite(M m) { return !m; }
static inline M odd_bits(B b) { return (int)(b & 1); }
static inline V pick(M m, V a) { return m ? a : 0.0; }
static inline V choose(M m, V a, V b) { return m ? a : b; }
static inline V least(V a, V b) { return a < b ? a : b; }
static inline V most(V a, V b) { return a > b ? a : b; }
static inline V root(V x) { return __builtin_sqrt(x); }
#elif defined(__AVX512F__) && defined(__AVX512DQ__) && LANES == 8
#include <immintrin.h>
typedef __mmask8 M;
static inline M less(V a, V b) { return _mm512_cmp_pd_mask((__m512d)a, (__m512d)b, _CMP_LT_OQ); }
static inline M less_equal(V a, V b) { return _mm512_cmp_pd_mask((__m512d)a, (__m512d)b, _CMP_LE_OQ); }
static inline M equal(V a, V b) { return _mm512_cmp_pd_mask((__m512d)a, (__m512d)b, _CMP_EQ_OQ); }
static inline M both(M a, M b) { return (M)(a & b); }
static inline M either(M a, M b) { return (M)(a | b); }
static inline M opposite(M m) { return (M)~m; }
static inline M odd_bits(B b) { return _mm512_test_epi64_mask((__m512i)b, _mm512_set1_epi64(1)); }
static inline V pick(M m, V a) { return (V)_mm512_maskz_mov_pd(m, (__m512d)a); }
static inline V choose(M m, V a, V b) { return (V)_mm512_mask_blend_pd(m, (__m512d)b, (__m512d)a); }
static inline V least(V a, V b) { return (V)_mm512_min_pd((__m512d)a, (__m512d)b); }
static inline V most(V a, V b) { return (V)_mm512_max_pd((__m512d)a, (__m512d)b); }
static inline V root(V x) { return (V)_mm512_sqrt_pd((__m512d)x); }
#elif defined(__AVX2__) && LANES == 4
#include <immintrin.h>
typedef B M;
static inline M less(V a, V b) { return (M)(a < b); }
static inline M less_equal(V a, V b) { return (M)(a <= b); }
static inline M equal(V a, V b) { return (M)(a == b); }
static inline M both(M a, M b) { return a & b; }
static inline M either(M a, M b) { return a | b; }
static inline M opposite(M m) { return ~m; }
static inline M odd_bits(B b) { return -(b & KB(1)); }
static inline V pick(M m, V a) { return (V)((B)a & m); }
static inline V choose(M m, V a, V b) { return (V)_mm256_blendv_pd((__m256d)b, (__m256d)a, (__m256d)m); }
static inline V least(V a, V b) { return (V)_mm256_min_pd((__m256d)a, (__m256d)b); }
static inline V most(V a, V b) { return (V)_mm256_max_pd((__m256d)a, (__m256d)b); }
static inline V root(V x) { return (V)_mm256_sqrt_pd((__m256d)x); }
#else
typedef B M;
static inline M less(V a, V b) { return (M)(a < b); }
static inline M less_equal(V a, V b) { return (M)(a <= b); }
static inline M equal(V a, V b) { return (M)(a == b); }
static inline M both(M a, M b) { return a & b; }
static inline M either(M a, M b) { return a | b; }
static inline M opposite(M m) { return ~m; }
static inline M odd_bits(B b) { return -(b & KB(1)); }
static inline V pick(M m, V a) { return (V)((B)a & m); }
static inline V choose(M m, V a, V b) { return (V)(((B)a & m) | ((B)b & ~m)); }
static inline V least(V a, V b) { return choose(less(a, b), a, b); }
static inline V most(V a, V b) { return choose(less(b, a), a, b); }
static inline V root(V x) { V r; FOR_LANES(i) r[i] = __builtin_sqrt(x[i]); return r; }
#endif

static inline V magnitude(V x) { return from_bits(bits(x) & KB(INT64_MAX)); }
static inline V with_sign(V x, V s) { return from_bits((bits(x) & KB(INT64_MAX)) | (bits(s) & KB(INT64_MIN))); }
static inline V number(M m) { return pick(m, K(1.0)); }
static inline M truth(V x) { return opposite(equal(x, K(0.0))); }
static inline V signum(V x) { return pick(less(K(0.0), x), K(1.0)) - pick(less(x, K(0.0)), K(1.0)); }

/* Adding 1.5 * 2^52 rounds to the nearest integer and leaves it in the low bits, for |x| < 2^51. */
#define ROUNDER 6755399441055744.0
static inline V floored(V x)
{
    V whole = with_sign((magnitude(x) + K(4503599627370496.0)) - K(4503599627370496.0), x); /* 2^52 */
    V r = choose(less(magnitude(x), K(4503599627370496.0)), whole, x);
    return r - pick(less(x, r), K(1.0));
}
static inline V ceiled(V x) { return -floored(-x); }

/* Sine and cosine together: reduction by pi/2 in three parts (to rounding for |x| up to 1e6, to 1e-7 up
   to 1e9; runs are stopped before their angles go beyond), then the usual minimax polynomials on |r| <= pi/4; the quadrant comes out of the rounder's low bits. */
static inline void sine_cosine(V x, V *sine, V *cosine)
{
    V shifted = x * K(0x1.45f306dc9c883p-1) + K(ROUNDER);
    V n = shifted - K(ROUNDER);
    V r = ((x - n * K(0x1.921fb54400000p+0)) - n * K(0x1.0b4611a600000p-34)) - n * K(0x1.3198a2e037073p-69);
    V z = r * r;
    V s = r + r * z * (K(-0x1.5555555555549p-3) + z * (K(0x1.111111110f8a6p-7) + z * (K(-0x1.a01a019c161d5p-13)
        + z * (K(0x1.71de357b1fe7dp-19) + z * (K(-0x1.ae5e68a2b9cebp-26) + z * K(0x1.5d93a5acfd57cp-33))))));
    V c = (K(1.0) - K(0.5) * z) + z * z * (K(0x1.555555555554cp-5) + z * (K(-0x1.6c16c16c15177p-10)
        + z * (K(0x1.a01a019cb1590p-16) + z * (K(-0x1.27e4f809c52adp-22) + z * (K(0x1.1ee9ebdb4b1c4p-29)
        + z * K(-0x1.8fae9be8838d4p-37))))));
    B quadrant = bits(shifted);
    M odd = odd_bits(quadrant);
    B upper = quadrant << 62 & KB(INT64_MIN), parity = quadrant << 63;
    *sine = from_bits(bits(choose(odd, c, s)) ^ upper);
    *cosine = from_bits(bits(choose(odd, s, c)) ^ (upper ^ parity));
}

/* Arc tangent of y/x in (-pi, pi]: the ratio of the smaller to the larger, then a further reduction
   by pi/4 and the usual polynomial on |t| <= tan(pi/8). */
static inline V arc_tangent2(V y, V x)
{
    V ax = magnitude(x), ay = magnitude(y);
    M steep = less(ax, ay);
    V larger = choose(steep, ay, ax), smaller = choose(steep, ax, ay);
    M wide = less(larger * K(0x1.a827999fcef32p-2), smaller);
    V top = choose(wide, smaller - larger, smaller);
    V bottom = choose(wide, smaller + larger, larger);
    M zero = equal(bottom, K(0.0)); /* both are 0: 0 over 1 */
    V t = top / choose(zero, K(1.0), bottom);
    V z = t * t, w = z * z;
    V even = z * (K(0x1.555555555550dp-2) + w * (K(0x1.24924920083ffp-3) + w * (K(0x1.745cdc54c206ep-4)
        + w * (K(0x1.10d66a0d03d51p-4) + w * (K(0x1.97b4b24760debp-5) + w * K(0x1.0ad3ae322da11p-6))))));
    V odd = w * (K(-0x1.999999998ebc4p-3) + w * (K(-0x1.c71c6fe231671p-4) + w * (K(-0x1.3b0f2af749a6dp-4)
        + w * (K(-0x1.dde2d52defd9ap-5) + w * K(-0x1.2b4442c6a6c2fp-5)))));
    V a = t - t * (even + odd);
    a = a + pick(wide, K(0x1.921fb54442d18p-1));
    a = choose(steep, K(0x1.921fb54442d18p+0) - a, a);
    a = choose(less(with_sign(K(1.0), x), K(0.0)), K(0x1.921fb54442d18p+1) - a, a);
    a = with_sign(a, y);
    return choose(both(equal(x, x), equal(y, y)), a, x + y);
}
static inline V arc_tangent(V x) { return arc_tangent2(x, K(1.0)); }
static inline V arc_sine(V x) { return arc_tangent2(x, root((K(1.0) - x) * (K(1.0) + x))); }
static inline V arc_cosine(V x) { return arc_tangent2(root((K(1.0) - x) * (K(1.0) + x)), x); }

/* Exponential: 2^n exp(r), |r| <= ln(2)/2; flushed to 0 below -708, infinite above 709. */
static inline V exponential(V x)
{
    V held = least(most(x, K(-708.0)), K(709.0));
    V shifted = held * K(0x1.71547652b82fep+0) + K(ROUNDER);
    V n = shifted - K(ROUNDER);
    V r = (held - n * K(0x1.62e42fee00000p-1)) - n * K(0x1.a39ef35793c76p-33);
    V z = r * r;
    V c = r - z * (K(0x1.555555555553ep-3) + z * (K(-0x1.6c16c16bebd93p-9) + z * (K(0x1.1566aaf25de2cp-14)
        + z * (K(-0x1.bbd41c5d26bf1p-20) + z * K(0x1.6376972bea4d0p-25)))));
    V e = K(1.0) + (r * c / (K(2.0) - c) + r);
    V scale = from_bits((bits(shifted) << 52) + bits(K(1.0)));
    V result = e * scale;
    result = choose(less(x, K(-708.0)), K(0.0), result);
    result = choose(less(K(709.0), x), from_bits(KB(0x7ff0000000000000)), result);
    return choose(equal(x, x), result, x);
}
