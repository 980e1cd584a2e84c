#pragma once

#include <cmath>

// The headers of this folder hold every formula of the method once, each f with its gradient fVjp
// right below it. f maps inputs to an output; fVjp maps d loss / d output to d loss / d inputs
// (vector-Jacobian product). They are templates on the scalar: float on the host and in CUDA
// kernels, vector lanes on the CPU (kernels/cpu/simd/lanes.h), double in the gradient tests. So
// they branch only on plain ints and bools, and choose between values with Select. They are always
// inlined, so that they are compiled for the instruction set of the caller.
#ifdef __CUDACC__
#define PEPESEG_HD __host__ __device__ __forceinline__
// For functions whose results two kernels must find equal to the last bit. Not inlined on a device,
// because each place of inlining may fuse multiplications and additions differently. Such functions
// take their arguments by value.
#define PEPESEG_HD_SAME_BITS inline __host__ __device__ __noinline__
#else
#define PEPESEG_HD inline __attribute__((always_inline))
#define PEPESEG_HD_SAME_BITS PEPESEG_HD
#endif

namespace pepeseg {

PEPESEG_HD float Sqrt(float x) { return ::sqrtf(x); }
PEPESEG_HD double Sqrt(double x) { return ::sqrt(x); }
PEPESEG_HD float Exp(float x) { return ::expf(x); }
PEPESEG_HD double Exp(double x) { return ::exp(x); }
PEPESEG_HD float Log(float x) { return ::logf(x); }
PEPESEG_HD double Log(double x) { return ::log(x); }
PEPESEG_HD float Cos(float x) { return ::cosf(x); }
PEPESEG_HD double Cos(double x) { return ::cos(x); }
PEPESEG_HD float Exp2(float x) { return ::exp2f(x); }
PEPESEG_HD double Exp2(double x) { return ::exp2(x); }
PEPESEG_HD float Log2(float x) { return ::log2f(x); }
PEPESEG_HD double Log2(double x) { return ::log2(x); }

// a b + c and c - a b. The compiler fuses them, with one rounding, where the instruction set can.
PEPESEG_HD float MulAdd(float a, float b, float c) { return a * b + c; }
PEPESEG_HD double MulAdd(double a, double b, double c) { return a * b + c; }
PEPESEG_HD float NegMulAdd(float a, float b, float c) { return c - a * b; }
PEPESEG_HD double NegMulAdd(double a, double b, double c) { return c - a * b; }

// Both values are evaluated: no branch. Lanes have an overload that selects lane by lane.
template <class T>
PEPESEG_HD T Select(bool condition, T if_true, T if_false) {
  return condition ? if_true : if_false;
}
// For plain scalars, Min and Max return `a` if either argument is NaN.
template <class T>
PEPESEG_HD T Min(T a, T b) {
  return Select(b < a, b, a);
}
template <class T>
PEPESEG_HD T Max(T a, T b) {
  return Select(a < b, b, a);
}
template <class T>
PEPESEG_HD T Abs(T x) {
  return Max(x, T(0) - x);
}
// Returns whether -1e30 < x < 1e30, as a bool or a mask of lanes. False for NaN, infinities, and
// beyond these bounds, where float products overflow.
template <class T>
PEPESEG_HD auto IsUsable(T x) {
  return (x < T(1e30f)) & (T(-1e30f) < x);
}

}  // namespace pepeseg
