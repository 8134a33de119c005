#pragma once
// Numbers that look random and are not.

#include <cstdint>

namespace pointwright {

/// A bijection of 64 bits: the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
inline std::uint64_t mixed_bits(std::uint64_t z) {
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31U);
}

}  // namespace pointwright
