#pragma once
// Which instruction set the kernels use, and how to call a kernel.
//
// A kernel `void f(const Args&, std::size_t begin, std::size_t end)` in `x_kernels.inc` (engine/core/simd.h
// says how to write one), with its argument struct, a plain aggregate of raw pointers and numbers:
//
//   // x_kernels.h: includes <cstddef>, <cstdint> and this header only
//   POINTWRIGHT_DECLARE_KERNEL(void f(const Args& args, std::size_t begin, std::size_t end))
//   // x_kernels.inc: includes "x_kernels.h" and "engine/core/simd.h"
//   namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE { void f(const Args& args, ...) { ... } }
//   // CMakeLists.txt
//   pointwright_add_kernels(pointwright_engine x_kernels.inc)
//   // the caller; look the kernel up once, outside the parallel loop
//   const auto f = POINTWRIGHT_KERNEL(f);

namespace pointwright {

enum class SimdLevel : int {
  kBase = 0,  ///< what the portable build requires: x86-64-v2, or 64-bit Arm with NEON
  kV3 = 1,    ///< AVX2
  kV4 = 2,    ///< AVX-512 F, VL, BW, DQ, CD
};

/// The widest level that this machine can run.
SimdLevel best_simd_level();
/// The level in use: the best one unless set otherwise. Thread-safe.
SimdLevel simd_level();
/// Chooses a level for the whole process; one beyond the machine's becomes the machine's best. For tests and
/// benchmarks: results are the same bytes on every level. Thread-safe.
void set_simd_level(SimdLevel level);

/// Of the variants of one kernel, the one for the level in use.
template <typename Function>
Function* pick_kernel(Function* base, Function* v3, Function* v4) {
  switch (simd_level()) {
    case SimdLevel::kV4:
      return v4;
    case SimdLevel::kV3:
      return v3;
    case SimdLevel::kBase:
      break;
  }
  return base;
}

}  // namespace pointwright

// NOLINTBEGIN(cppcoreguidelines-macro-usage): one declaration per instruction set needs a macro.
#if defined(__x86_64__)
#define POINTWRIGHT_DECLARE_KERNEL(...) \
  namespace pointwright {               \
  namespace simd_base {                 \
  __VA_ARGS__;                          \
  }                                     \
  namespace simd_v3 {                   \
  __VA_ARGS__;                          \
  }                                     \
  namespace simd_v4 {                   \
  __VA_ARGS__;                          \
  }                                     \
  }
#define POINTWRIGHT_KERNEL(name)                                                              \
  (::pointwright::pick_kernel(&::pointwright::simd_base::name, &::pointwright::simd_v3::name, \
                              &::pointwright::simd_v4::name))
#else
#define POINTWRIGHT_DECLARE_KERNEL(...) \
  namespace pointwright {               \
  namespace simd_base {                 \
  __VA_ARGS__;                          \
  }                                     \
  }
#define POINTWRIGHT_KERNEL(name) (&::pointwright::simd_base::name)
#endif
// NOLINTEND(cppcoreguidelines-macro-usage)
