#pragma once
// What the daemon and its decoder say to each other. Both are the same program on the same machine: native
// layout.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/editing/image.h"
#include "engine/io/cloud_io.h"

namespace pointwright {

/// Descriptors of the decoder; every other is closed.
inline constexpr int kRequestDescriptor = 3;  ///< memory file: a DecodeRequest
inline constexpr int kAnswerDescriptor = 4;   ///< empty memory file: an AnswerKind, then a blob or an error
inline constexpr int kAliveDescriptor = 5;    ///< a pipe's write end that closes when the decoder is gone
inline constexpr int kInputDescriptor = 6;    ///< the file to decode, or a memory file with its bytes

/// What a decoder is asked to read.
enum class DecodeSubject : std::uint64_t { kCloud = 0, kImage = 1 };

struct DecodeRequest {
  static constexpr std::uint64_t kMagic = 0x3251455254575054ULL;
  std::uint64_t magic = kMagic;
  DecodeSubject subject = DecodeSubject::kCloud;
  std::uint64_t format = 0;           // of a cloud
  std::uint64_t drop_non_finite = 0;  // of a cloud
  std::uint64_t max_samples = 0;      // of a cloud
  std::uint64_t max_side = 0;         // of an image
  std::uint64_t max_pixels = 0;       // of an image
  std::uint64_t byte_count = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t cpu_seconds = 0;
};
static_assert(sizeof(DecodeRequest) == 80);

enum class AnswerKind : std::uint64_t { kNone = 0, kCloud = 1, kError = 2, kImage = 3 };

/// What comes before an image's values.
struct ImageHead {
  AnswerKind kind = AnswerKind::kImage;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t channels = 0;
  std::uint32_t bytes_per_value = 0;
};

std::vector<std::byte> error_answer(const Error& error);

/// The decoded cloud or the error that the answer holds. Nothing in it is trusted.
Result<ImportedCloud> read_answer(std::span<const std::byte> answer);
/// The decoded image or the error, trusted no more.
Result<Image> read_image_answer(std::span<const std::byte> answer);

}  // namespace pointwright
