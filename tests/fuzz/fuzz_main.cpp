// One libFuzzer program per target; the build defines which.
#include <cstdint>

#include "tests/fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  pointwright::fuzz::POINTWRIGHT_FUZZ_TARGET(std::as_bytes(std::span(data, size)));
  return 0;
}
