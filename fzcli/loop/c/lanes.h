/* Arithmetic on LANES simulations at once: V holds one double a lane, M one mask a lane.
   Everything is written out from + - * / and comparisons, without libm and without contraction,
   so that any compiler, any lane width and any IEEE 754 host give the same bits. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifndef LANES
#define LANES 1
#endif

#if LANES == 1
typedef double V;
typedef int64_t M;
#define K(x) (x)
#define AS_M(comparison) (-(M)(comparison))
#define FOR_LANES(i) for (int i = 0; i < 1; ++i)
#define LANE(v, i) (v)
static inline V pick(M m, V a) { return m ? a : 0.0; }
static inline V choose(M m, V a, V b) { return m ? a : b; }
static inline V flip_sign(V x, M where) { return where ? -x : x; }
static inline V root(V x) { return __builtin_sqrt(x); }
static inline V magnitude(V x) { return __builtin_fabs(x); }
static inline V with_sign(V x, V sign) { return __builtin_copysign(x, sign); }
static inline M bits(V x) { M m; memcpy(&m, &x, sizeof m); return m; }
static inline V from_bits(M m) { V x; memcpy(&x, &m, sizeof x); return x; }
#else
typedef double V __attribute__((vector_size(8 * LANES)));
typedef int64_t M __attribute__((vector_size(8 * LANES)));
#if LANES == 2
#define K(x) ((V){x, x})
#define KM(x) ((M){x, x})
#elif LANES == 4
#define K(x) ((V){x, x, x, x})
#define KM(x) ((M){x, x, x, x})
#elif LANES == 8
#define K(x) ((V){x, x, x, x, x, x, x, x})
#define KM(x) ((M){x, x, x, x, x, x, x, x})
#else
#error "LANES is 1, 2, 4 or 8"
#endif
#define AS_M(comparison) ((M)(comparison))
#define FOR_LANES(i) for (int i = 0; i < LANES; ++i)
#define LANE(v, i) ((v)[i])
static inline M bits(V x) { return (M)x; }
static inline V from_bits(M m) { return (V)m; }
static inline V pick(M m, V a) { return (V)((M)a & m); }
static inline V choose(M m, V a, V b) { return (V)(((M)a & m) | ((M)b & ~m)); }
static inline V flip_sign(V x, M where) { return (V)((M)x ^ (where & KM(INT64_MIN))); }
#if defined(__AVX512F__) && LANES == 8
#include <immintrin.h>
static inline V root(V x) { return (V)_mm512_sqrt_pd((__m512d)x); }
#elif defined(__AVX__) && LANES == 4
#include <immintrin.h>
static inline V root(V x) { return (V)_mm256_sqrt_pd((__m256d)x); }
#else
static inline V root(V x) { V r; FOR_LANES(i) r[i] = __builtin_sqrt(x[i]); return r; }
#endif
static inline V magnitude(V x) { return (V)((M)x & KM(INT64_MAX)); }
static inline V with_sign(V x, V sign) { return (V)(((M)x & KM(INT64_MAX)) | ((M)sign & KM(INT64_MIN))); }
#endif

static inline V least(V a, V b) { return choose(AS_M(a < b), a, b); }
static inline V most(V a, V b) { return choose(AS_M(a > b), a, b); }
static inline V number(M m) { return pick(m, K(1.0)); }
static inline M truth(V x) { return AS_M(x != K(0.0)); }
static inline V signum(V x) { return pick(AS_M(x > K(0.0)), K(1.0)) - pick(AS_M(x < K(0.0)), K(1.0)); }

/* To the nearest integer, exact for |x| < 2^51: adding 1.5 * 2^52 drops the fraction. */
#define ROUNDER 6755399441055744.0
static inline V nearest(V x) { return (x + K(ROUNDER)) - K(ROUNDER); }
static inline V floored(V x)
{
    V r = choose(AS_M(magnitude(x) < K(2251799813685248.0)), nearest(x), x);
    return r - pick(AS_M(r > x), K(1.0));
}
static inline V ceiled(V x) { return -floored(-x); }

/* Sine and cosine together: reduction by pi/2 in three parts (good to |x| of 1e5 and more), then
   the usual minimax polynomials on |r| <= pi/4; the quadrant comes out of the rounder's low bits. */
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
    M quadrant = bits(shifted);
    M odd = -(quadrant & 1);
    M upper = -((quadrant >> 1) & 1);
    V swapped_s = choose(odd, c, s), swapped_c = choose(odd, s, c);
    *sine = flip_sign(swapped_s, upper);
    *cosine = flip_sign(swapped_c, upper ^ odd);
}

/* Arc tangent of y/x in (-pi, pi]: the ratio of the smaller to the larger, then a further reduction
   by pi/4 and the usual polynomial on |t| <= tan(pi/8). */
static inline V arc_tangent2(V y, V x)
{
    V ax = magnitude(x), ay = magnitude(y);
    M steep = AS_M(ay > ax);
    V larger = choose(steep, ay, ax), smaller = choose(steep, ax, ay);
    M wide = AS_M(smaller > larger * K(0x1.a827999fcef32p-2));
    V top = choose(wide, smaller - larger, smaller);
    V bottom = choose(wide, smaller + larger, larger);
    V t = pick(AS_M(bottom != K(0.0)), top / choose(AS_M(bottom != K(0.0)), bottom, K(1.0)));
    V z = t * t, w = z * z;
    V even = z * (K(0x1.555555555550dp-2) + w * (K(0x1.24924920083ffp-3) + w * (K(0x1.745cdc54c206ep-4)
        + w * (K(0x1.10d66a0d03d51p-4) + w * (K(0x1.97b4b24760debp-5) + w * K(0x1.0ad3ae322da11p-6))))));
    V odd = w * (K(-0x1.999999998ebc4p-3) + w * (K(-0x1.c71c6fe231671p-4) + w * (K(-0x1.3b0f2af749a6dp-4)
        + w * (K(-0x1.dde2d52defd9ap-5) + w * K(-0x1.2b4442c6a6c2fp-5)))));
    V a = t - t * (even + odd);
    a = a + pick(wide, K(0x1.921fb54442d18p-1));
    a = choose(steep, K(0x1.921fb54442d18p+0) - a, a);
    a = choose(AS_M(x < K(0.0)), K(0x1.921fb54442d18p+1) - a, a);
    a = with_sign(a, y);
    return choose(AS_M(x == x) & AS_M(y == y), a, x + y);
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
    result = choose(AS_M(x < K(-708.0)), K(0.0), result);
    result = choose(AS_M(x > K(709.0)), K(1.0) / K(0.0), result);
    return choose(AS_M(x == x), result, x);
}
