/*
 * e^x and log x without branches, so that the compiler works on many at a time.
 *
 * The polynomials of the Cephes library (Moshier), each within 2e-7 of the true value; no input,
 * NaN included, leads to undefined behaviour.
 */
#ifndef ROADPRINT_APPROXIMATE_H
#define ROADPRINT_APPROXIMATE_H

#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

/* x86 since 2013 works on eight floats at once, newer ones on sixteen; the loader picks. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && \
    __GNUC__ >= 12 && !defined(__SANITIZE_ADDRESS__)
#define FOR_EACH_MACHINE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FOR_EACH_MACHINE
#endif

/* x is cut to -87..87, where the result is a normal number. */
INLINE float exponential(float x)
{
    const float rounder = 12582912.0f; /* 1.5 * 2^23: adding it leaves no digit after the point */
    x = x > -87.0f ? x : -87.0f;
    x = x < 87.0f ? x : 87.0f;
    float whole = (x * 1.44269504f + rounder) - rounder;
    float rest = x - whole * 0.693359375f + whole * 2.12194440e-4f;
    float series = 1.9875691500e-4f;
    series = series * rest + 1.3981999507e-3f;
    series = series * rest + 8.3334519073e-3f;
    series = series * rest + 4.1665795894e-2f;
    series = series * rest + 1.6666665459e-1f;
    series = series * rest + 5.0000001201e-1f;
    int32_t bits = ((int32_t)whole + 127) * (1 << 23);
    float power;
    memcpy(&power, &bits, sizeof power);
    return (series * rest * rest + rest + 1.0f) * power;
}

/* Of a positive normal number. */
INLINE float logarithm(float x)
{
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    int32_t power = (bits >> 23) - 126;
    bits = (bits & 0x007fffff) | 0x3f000000;
    float part;
    memcpy(&part, &bits, sizeof part); /* x = part * 2^power, part in 0.5..1 */
    int32_t low = part < 0.707106781f;
    part = part - 1.0f + (low ? part : 0.0f);
    float whole = (float)(power - low), square = part * part;
    float series = 7.0376836292e-2f;
    series = series * part - 1.1514610310e-1f;
    series = series * part + 1.1676998740e-1f;
    series = series * part - 1.2420140846e-1f;
    series = series * part + 1.4249322787e-1f;
    series = series * part - 1.6668057665e-1f;
    series = series * part + 2.0000714765e-1f;
    series = series * part - 2.4999993993e-1f;
    series = series * part + 3.3333331174e-1f;
    float rest = series * part * square - 2.12194440e-4f * whole - 0.5f * square;
    return part + rest + 0.693359375f * whole;
}

#endif
