#include <stdexcept>
#include <string>

#include "server/ingest/png_reader.h"
#include "tests/fuzz/targets.h"

namespace pointwright::fuzz {

void try_png(std::span<const std::byte> bytes) {
  const auto promise = [](bool kept, const char* what) {
    if (!kept) throw std::logic_error(std::string("broken promise: ") + what);
  };
  constexpr ImageLimits kLimits{.max_side = 4096, .max_pixels = 1'000'000};
  const auto claim = png_gate(bytes, kLimits);
  const auto image = read_png(bytes, kLimits);
  if (!image.ok()) {
    promise(!image.error().message.empty(), "an error says something");
    return;
  }
  promise(claim.ok(), "what was read passed the gate");
  promise(is_valid(image.value()), "an image that was taken is valid");
  promise(image.value().width == claim.value().width && image.value().height == claim.value().height,
          "an image is as large as it claims");
  promise(value_bytes(image.value()) <= claim.value().value_bytes, "an image takes no more than it claims");
}

}  // namespace pointwright::fuzz
